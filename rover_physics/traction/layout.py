# SPDX-License-Identifier: Apache-2.0
"""Indices of the variables and rows of the traction control's quadratic program (QP).

All indices start at 0. Where a docstring says "First of", the entries of the six wheels follow in
wheel order: `x[LOAD + wheel]`. `program.py` explains the rows.
"""

from rover_physics.names import WHEEL_COUNT

LAST_WHEEL = WHEEL_COUNT - 1
"""The wheel whose traction follows from the balance and the other wheels' differences to it."""

# Variables. The first FORCES of them are also the variables of the balance.
TRACTION = 0
"""First of the tractions T (6): forces along the ground in the wheels' headings."""
LOAD = TRACTION + WHEEL_COUNT
"""First of the wheel loads N (6): forces normal to the ground, positive if the ground pushes."""
LATERAL_SHARE = LOAD + WHEEL_COUNT
"""s0 of the lateral forces; straight ahead it is the same for all wheels."""
LATERAL_SLOPE = LATERAL_SHARE + 1
"""s1 of the lateral forces; straight ahead their change along the body per rover length."""
FORCES = LATERAL_SLOPE + 1
"""Number of forces: tractions, loads and the two lateral terms."""
PEAK = FORCES
"""The largest friction utilisation u of all wheels."""
FRICTION_SLACK = PEAK + 1
"""Excess of the peak over 1."""
LOAD_SLACK = FRICTION_SLACK + 1
"""Amount by which the smallest load is below 0."""
TORQUE_SLACK = LOAD_SLACK + 1
"""Excess of the largest traction over the largest pull of a motor."""
VARIABLES = TORQUE_SLACK + 1
"""Number of variables."""

TRACTIONS = slice(TRACTION, TRACTION + WHEEL_COUNT)
"""The six tractions."""
LOADS = slice(LOAD, LOAD + WHEEL_COUNT)
"""The six loads."""

# Equations of the balance. The first six determine the loads of the wheels.
LATERAL_SHARE_EQUATION = LATERAL_SHARE - LOAD
"""The equation that determines s0."""
LATERAL_SLOPE_EQUATION = LATERAL_SLOPE - LOAD
"""The equation that determines s1."""
TRACTION_EQUATION = LATERAL_SLOPE_EQUATION + 1
"""The equation that determines the traction of LAST_WHEEL, by the principle of virtual work."""
EQUATIONS = TRACTION_EQUATION + 1
"""Number of equations of the balance."""

# Rows.
CONE_SIDES = 4
"""Number of tangents that replace the friction cone of one wheel."""
BALANCE_ROWS = 0
"""First of the EQUATIONS rows of the balance."""
CONE_ROWS = BALANCE_ROWS + EQUATIONS
"""First of the tangents of the friction cones: CONE_SIDES of the first wheel, then the next."""
PEAK_LIMIT_ROW = CONE_ROWS + WHEEL_COUNT * CONE_SIDES
"""Row that limits the peak utilisation to 1 plus its slack."""
LOAD_ROWS = PEAK_LIMIT_ROW + 1
"""First of the six rows that keep a load at or above 0 minus its slack."""
FORWARD_PULL_ROWS = LOAD_ROWS + WHEEL_COUNT
"""First of the six rows that limit a traction to the motor's largest pull plus its slack."""
BACKWARD_PULL_ROWS = FORWARD_PULL_ROWS + WHEEL_COUNT
"""First of the six rows that limit a backward traction in the same way."""
SIGN_ROWS = BACKWARD_PULL_ROWS + WHEEL_COUNT
"""First of the rows that keep the variables from PEAK on at or above 0."""
ROWS = SIGN_ROWS + VARIABLES - PEAK
"""Number of rows."""
