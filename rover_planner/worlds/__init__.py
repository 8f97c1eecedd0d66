# SPDX-License-Identifier: Apache-2.0
"""Terrains: generated from a seed with relief, craters and rocks, or from a client's file."""
