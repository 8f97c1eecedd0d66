# SPDX-License-Identifier: Apache-2.0
"""Reads joint state messages: measured joint angles and rates by name; the steering's sign."""

import math
from collections.abc import Collection, Mapping, Sequence

from sensor_msgs.msg import JointState

from msg_adapters.errors import MessageError
from rover_physics.names import STEERING_JOINTS
from rover_physics.rover.steering_joints import STEERING_SIGNS

_PLURALS = {"position": "positions", "velocity": "velocities"}


def joint_positions(state: JointState, wanted: Collection[str]) -> dict[str, float]:
    """Return the positions [rad] of the wanted joints in a message, by name.

    Other joints are ignored. The result is empty if the message has no positions, for example
    only velocities or efforts.

    Raises:
        MessageError: position has another length than name, a wanted joint occurs twice, or
            its position is not finite.
    """
    return _read_by_name(state, state.position, "position", "angle in rad", wanted)


def joint_velocities(state: JointState, wanted: Collection[str]) -> dict[str, float]:
    """Return the velocities [rad/s] of the wanted joints in a message, by name.

    Raises:
        MessageError: As in `joint_positions`, about velocity.
    """
    return _read_by_name(state, state.velocity, "velocity", "rate in rad/s", wanted)


def convert_steering(values: Mapping[str, float], positive: str) -> dict[str, float]:
    """Return angles or rates by joint name with the sign of steering joints of messages or ours.

    The conversion is the same both ways. Other joints keep their values.

    Args:
        values: Angles [rad] or rates [rad/s] by joint name.
        positive: One of STEERING_SIGNS: the side to which positive angles of the messages turn.
    """
    sign = STEERING_SIGNS[positive]
    return {
        name: sign * value if name in STEERING_JOINTS else value for name, value in values.items()
    }


def _read_by_name(
    state: JointState, values: Sequence[float], field: str, right: str, wanted: Collection[str]
) -> dict[str, float]:
    if not values:
        return {}
    if len(values) != len(state.name):
        raise MessageError(
            f"joint_states has {len(values)} {_PLURALS[field]} for {len(state.name)} names; "
            "there must be one for each, or none at all"
        )
    found: dict[str, float] = {}
    for name, value in zip(state.name, values, strict=True):
        if name not in wanted:
            continue
        if name in found:
            raise MessageError(f"joint_states names {name} twice")
        if not math.isfinite(value):
            raise MessageError(
                f"joint_states has {field} {value} of {name}; it must be a finite {right}"
            )
        found[name] = float(value)
    return found
