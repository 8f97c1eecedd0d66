# SPDX-License-Identifier: Apache-2.0
"""The rovers that come with the package, and some that steer otherwise; all tests share them."""

import math
from dataclasses import replace

from rover_physics import load_rover
from rover_physics.rover.model import Steering

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
FIXED = replace(LSR1, steering=None)
"""The rover lsr1 with wheels that do not steer."""
ALL_STEER = replace(LSR1, steering=Steering(("rear", "middle", "front"), 0.5 * math.pi, 0.35))
"""The rover lsr1 with six wheels that steer."""
