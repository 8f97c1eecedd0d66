# SPDX-License-Identifier: Apache-2.0
"""A map that lives: loaded and local maps merged cell by cell, and the ground under the rover."""
