# SPDX-License-Identifier: Apache-2.0
"""Names of wheels, sides and joints, in the order of all arrays, and names of torque policies."""

WHEELS = (
    "rear_right",
    "middle_right",
    "front_right",
    "rear_left",
    "middle_left",
    "front_left",
)
"""Wheel order of every per-wheel array, as in the paper: the right side first, rear to front."""

WHEEL_COUNT = len(WHEELS)
"""Number of wheels."""

SIDES = ("right", "left")
"""Side order of every per-side array."""

WHEEL_POSITIONS = ("rear", "middle", "front")
"""Names of the wheels of one side, rear to front; the keys of ``suspension.wheels``."""

SUSPENSION_JOINTS = ("rocker_right", "rocker_left", "bogie_right", "bogie_left")
"""Names of the suspension joints in joint messages."""

WHEEL_JOINTS = tuple(f"{wheel}_wheel" for wheel in WHEELS)
"""Names of the wheel drive joints in joint messages, in wheel order."""

STEERING_JOINTS = tuple(f"{wheel}_steering" for wheel in WHEELS)
"""Names of the steering joints in joint messages, in wheel order; a rover has those of its steered
wheels. Their angles are positive to the left."""

EQUAL, SERVO, OPTIMAL = "equal", "servo", "optimal"
TORQUE_POLICIES = (EQUAL, SERVO, OPTIMAL)
"""Torque policies: equal torques on all wheels; the torques of speed servos; the torques that need
the least friction. In this order traversability classes ask for them."""
CONTROL_POLICIES = (EQUAL, OPTIMAL)
"""Torque policies of the traction controller, which commands torques."""
