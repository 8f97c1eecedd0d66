# SPDX-License-Identifier: Apache-2.0
"""The pages: one that plans, one that follows a live rover."""
