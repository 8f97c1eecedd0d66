# SPDX-License-Identifier: Apache-2.0
"""Terrain: elevation maps with their layers, soils, and height look-up for kernels."""
