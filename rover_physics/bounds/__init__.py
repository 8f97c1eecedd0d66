# SPDX-License-Identifier: Apache-2.0
"""Bounds on predictions over uncertain maps."""
