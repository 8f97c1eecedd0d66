"""Where each variable and each row of the traction control's quadratic program (QP) stands.

All are offsets from 0. A name in the plural, or one with a count beside it, is the first of six in
wheel order: `x[LOAD + wheel]`. `program.py` says what the rows mean.
"""

from rover_physics.names import WHEEL_COUNT

LAST_WHEEL = WHEEL_COUNT - 1
"""The wheel whose traction follows from the differences between the others and it."""

# Variables. The first FORCES of them are also what the balance is written in.
TRACTION = 0
"""First of the tractions T (6): forces along the ground, positive forward."""
LOAD = TRACTION + WHEEL_COUNT
"""First of the wheel loads N (6): forces normal to the ground, positive where it pushes."""
LATERAL_SHARE = LOAD + WHEEL_COUNT
"""s0 of the lateral forces S_i = s0 + s1 along_i: what all wheels have in common."""
LATERAL_SLOPE = LATERAL_SHARE + 1
"""s1 of the same: how they change along the body, per length of the rover."""
FORCES = LATERAL_SLOPE + 1
"""Number of forces: tractions, loads and the two lateral terms."""
PEAK = FORCES
"""The peak friction utilisation u of all wheels."""
FRICTION_SLACK = PEAK + 1
"""By how much the peak is above 1."""
LOAD_SLACK = FRICTION_SLACK + 1
"""By how much the smallest load is below 0."""
TORQUE_SLACK = LOAD_SLACK + 1
"""By how much the largest traction is above the largest pull of a motor."""
VARIABLES = TORQUE_SLACK + 1
"""Number of variables."""

TRACTIONS = slice(TRACTION, TRACTION + WHEEL_COUNT)
"""The six tractions."""
LOADS = slice(LOAD, LOAD + WHEEL_COUNT)
"""The six loads."""

# Equations of the balance, solved for what they determine: first the loads of the six wheels.
LATERAL_SHARE_EQUATION = LATERAL_SHARE - LOAD
"""The one that determines s0."""
LATERAL_SLOPE_EQUATION = LATERAL_SLOPE - LOAD
"""The one that determines s1."""
TRACTION_EQUATION = LATERAL_SLOPE_EQUATION + 1
"""The one that determines the traction of LAST_WHEEL; it is that of virtual work."""
EQUATIONS = TRACTION_EQUATION + 1
"""Number of equations of the balance."""

# Rows.
CONE_SIDES = 4
"""Tangents that replace the friction cone of one wheel."""
BALANCE_ROWS = 0
"""First of the EQUATIONS rows of the balance."""
CONE_ROWS = BALANCE_ROWS + EQUATIONS
"""First of the tangents of the friction cones: CONE_SIDES of the first wheel, then the next."""
PEAK_LIMIT_ROW = CONE_ROWS + WHEEL_COUNT * CONE_SIDES
"""Peak utilisation at most 1, but for its slack."""
LOAD_ROWS = PEAK_LIMIT_ROW + 1
"""First of the six that keep a load at or above 0, but for its slack."""
FORWARD_PULL_ROWS = LOAD_ROWS + WHEEL_COUNT
"""First of the six that limit a traction by the motor's largest pull, but for its slack."""
BACKWARD_PULL_ROWS = FORWARD_PULL_ROWS + WHEEL_COUNT
"""First of the six that do so backward."""
SIGN_ROWS = BACKWARD_PULL_ROWS + WHEEL_COUNT
"""First of those that keep all variables from PEAK on at or above 0."""
ROWS = SIGN_ROWS + VARIABLES - PEAK
"""Number of rows."""
