# SPDX-License-Identifier: Apache-2.0
"""The maps of a traverse server as topics and services."""
