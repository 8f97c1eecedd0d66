# SPDX-License-Identifier: Apache-2.0
"""A live rover: the data of its topics, kept for the page."""
