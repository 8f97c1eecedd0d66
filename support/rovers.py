# SPDX-License-Identifier: Apache-2.0
"""The rovers that come with the package, and one whose wheels are fixed; all tests share them."""

from dataclasses import replace

from rover_physics import load_rover

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
FIXED = replace(LSR1, steering=None)
"""The rover lsr1 with wheels that do not steer."""
