# SPDX-License-Identifier: Apache-2.0
"""Finds a path around obstacles: a search over x, y and heading on the full model."""
