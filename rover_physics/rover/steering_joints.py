# SPDX-License-Identifier: Apache-2.0
"""The steered wheels of a rover and the joints that turn them: names, sign and limit."""

import math

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import ModelError
from rover_physics.names import STEERING_JOINTS, WHEEL_POSITIONS
from rover_physics.rover.model import Rover

LEFT, RIGHT = "left", "right"
STEERING_SIGNS = {LEFT: 1.0, RIGHT: -1.0}
"""Signs of steering angles in messages over those here, by the side to which positive ones turn.
REP-103 has them positive to the left; some rovers have it the other way round."""
MARGIN = 1e-3
"""Angle by which a limit may be rounded [rad]."""


def steered_wheels(rover: Rover) -> NDArray[np.intp]:
    """Return the indices of the wheels that steer, in wheel order; empty if all are fixed."""
    axles = () if rover.steering is None else rover.steering.wheels
    return np.flatnonzero([position in axles for position in WHEEL_POSITIONS * 2])


def steering_joints(rover: Rover) -> tuple[str, ...]:
    """Return the names of the joints of these wheels, in the same order."""
    return tuple(STEERING_JOINTS[wheel] for wheel in steered_wheels(rover).tolist())


def check_joint_limit(rover: Rover, joint_limit: float) -> None:
    """Check that the joints reach the angles for which curves and turns are planned.

    Args:
        rover: The rover; curves are planned up to its steering limit, but no wheel needs more than
            a quarter turn, as it rolls backwards as well.
        joint_limit: Largest angle of the joints [rad].

    Raises:
        ModelError: The joints do not reach the limit of the rover file.
    """
    if rover.steering is None:
        return
    asked = min(rover.steering.limit, 0.5 * math.pi)
    if joint_limit < asked - MARGIN:
        raise ModelError(
            f"steering joints of {rover.name} reach {joint_limit:g} rad, but curves and turns on "
            f"the spot are planned with up to {asked:.4g} rad; steering.limit of the rover file "
            f"must be at most {joint_limit:g}"
        )
