# SPDX-License-Identifier: Apache-2.0
"""Bounds of plausible quantities: wide enough for any rover, narrow enough to compute with.

A number beyond them is an error of units or a damaged message. Within them, products and squares
stay far from the range of floating-point numbers.
"""

MAX_COORDINATE = 1e9
"""Largest coordinate, height or distance [m]; Jupiter's radius is 7e7 m. Doubles are exact to
1e-7 m there."""
MIN_RESOLUTION, MAX_RESOLUTION = 1e-5, 1e6
"""Smallest and largest cell of a map [m]."""
MIN_LENGTH, MAX_LENGTH = 1e-3, 1e3
"""Smallest and largest radius or width of a wheel, and largest coordinate on a rover [m]."""
MAX_MASS = 1e9
"""Largest mass of a part [kg]; the heaviest land vehicle has 1.4e7 kg."""
MIN_GRAVITY, MAX_GRAVITY = 1e-6, 1e3
"""Smallest and largest gravity [m/s^2]: 6e-5 on the asteroid Bennu, 25 on Jupiter."""
MIN_FRICTION, MAX_FRICTION = 1e-6, 1e6
"""Smallest and largest friction coefficient; rubber on rock has about 1."""
MIN_SPEED, MAX_SPEED = 1e-9, 1e6
"""Smallest and largest speed [m/s] or wheel rate [rad/s]."""
MIN_STEERING = 1e-6
"""Smallest limit of a steering angle [rad]."""
MIN_TORQUE, MAX_TORQUE = 1e-9, 1e9
"""Smallest and largest torque of a drive [N m]."""
MAX_FORCE = 1e9
"""Largest force [N] or moment [N m] on the arm's tool."""
