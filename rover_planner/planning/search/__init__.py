# SPDX-License-Identifier: Apache-2.0
"""Searches a path around obstacles on a lattice of motion primitives, with the full model."""
