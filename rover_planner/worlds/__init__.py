# SPDX-License-Identifier: Apache-2.0
"""Terrains that are generated from a seed, with relief, craters and rocks."""
