# SPDX-License-Identifier: Apache-2.0
"""Reads joint states by name, with the robot's names, signs and offsets of the model's joints."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from msg_adapters.errors import MessageError
from rover_physics.names import STEERING_JOINTS
from rover_physics.rover.steering_joints import LEFT, RIGHT

_PLURALS = {"position": "positions", "velocity": "velocities"}
FORM = "model_joint:robot_joint, model_joint:robot_joint:-1 or model_joint:robot_joint:-1:0.05"
"""Form of an entry, for error texts."""


@dataclass(frozen=True)
class JointLink:
    """One joint of the model and its counterpart: angle = sign x angle in messages + offset."""

    model: str
    """Name of the joint in the model."""
    robot: str
    """Name of the joint in messages."""
    sign: float = 1.0
    """1, or -1 if positive angles of messages are negative ones of the model."""
    offset: float = 0.0
    """Angle of the model where the angle in messages is 0 [rad]."""


class JointNames:
    """Converts joint values of messages; joints that it does not name are the same in both."""

    def __init__(self, links: Sequence[JointLink] = (), steering: str = LEFT):
        """Take the links, and the side to which positive steering angles of messages turn.

        Raises:
            MessageError: A name occurs twice.
        """
        self._of_model = {link.model: link for link in links}
        self._of_robot = {link.robot: link for link in links}
        if not len(self._of_model) == len(self._of_robot) == len(links):
            names = [name for link in links for name in {link.model, link.robot}]
            twice = sorted({name for name in names if names.count(name) > 1})
            raise MessageError(
                f"joint_map names {', '.join(twice)} twice; each joint has one name"
            )
        for name in STEERING_JOINTS if steering == RIGHT else ():
            link = self.link(name)
            self._of_model[name] = replace(link, sign=-link.sign, offset=-link.offset)

    def link(self, model: str) -> JointLink:
        """Return the link of a joint of the model."""
        known = self._of_model.get(model)
        if known is None:
            known = self._of_model[model] = JointLink(model, model)
        return known

    def model_name(self, robot: str) -> str:
        """Return the name in the model of a joint of messages; the model's own name stays."""
        link = self._of_robot.get(robot)
        return robot if link is None else link.model

    def robot_names(self, names: Collection[str]) -> tuple[str, ...]:
        """Return the names in messages of joints of the model."""
        return tuple(self.link(name).robot for name in names)

    def positions(self, state: JointState, wanted: Collection[str]) -> dict[str, float]:
        """Return the angles [rad] of wanted joints of the model in a message, by name.

        Other joints are ignored. The result is empty if the message has no positions, for example
        only velocities or efforts.

        Raises:
            MessageError: position has another length than name, a wanted joint occurs twice, or
                its position is not finite.
        """
        values = self._read(state, "position", "angle in rad", wanted)
        return {link.model: link.sign * value + link.offset for link, value in values}

    def velocities(self, state: JointState, wanted: Collection[str]) -> dict[str, float]:
        """Return the rates [rad/s] of wanted joints of the model; as `positions`."""
        values = self._read(state, "velocity", "rate in rad/s", wanted)
        return {link.model: link.sign * value for link, value in values}

    def _read(
        self, state: JointState, field: str, right: str, wanted: Collection[str]
    ) -> list[tuple[JointLink, float]]:
        """Return the values of wanted joints that a message has, with their links."""
        values = getattr(state, field)
        if not values:
            return []
        if len(values) != len(state.name):
            raise MessageError(
                f"joint_states has {len(values)} {_PLURALS[field]} for {len(state.name)} names; "
                "there must be one for each, or none at all"
            )
        found = [(link, float(values[place])) for place, link in self.places(state.name, wanted)]
        for link, value in found:
            if not math.isfinite(value):
                raise MessageError(
                    f"joint_states has {field} {value} of {link.robot}; it must be a finite "
                    f"{right}"
                )
        return found

    def places(self, names: Sequence[str], wanted: Collection[str]) -> list[tuple[int, JointLink]]:
        """Return where wanted joints of the model are among the names of a message.

        Raises:
            MessageError: One of them occurs twice.
        """
        places = {name: place for place, name in enumerate(names)}
        links = [self.link(name) for name in wanted]
        for link in links if len(places) < len(names) else ():
            if names.count(link.robot) > 1:
                raise MessageError(f"joint_states names {link.robot} twice")
        return [(places[link.robot], link) for link in links if link.robot in places]

    def signs(self, names: Collection[str]) -> NDArray[np.float64]:
        """Return the signs of joints of the model, which rates and efforts have too."""
        return np.array([self.link(name).sign for name in names])

    def turn(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return rates or efforts by names of the model with the signs of messages."""
        return {name: self.link(name).sign * value for name, value in values.items()}

    def offsets(self, names: Collection[str]) -> NDArray[np.float64]:
        """Return the offsets of joints of the model [rad]."""
        return np.array([self.link(name).offset for name in names])


OWN_NAMES = JointNames()
"""The map of a robot whose joints have the names, signs and zeros of the model."""


def read_joint_map(
    entries: Sequence[str], known: Collection[str], steering: str = LEFT
) -> JointNames:
    """Return the map of the parameter joint_map.

    Args:
        entries: One text for each joint, in a form of FORM.
        known: Names of the joints of the model.
        steering: Side to which positive steering angles of messages turn.

    Raises:
        MessageError: An entry has another form, a joint that is not known, or a name that another
            joint has.
    """
    links = [_read_link(entry, known) for entry in entries]
    joints = JointNames(links, steering)
    own = {name for name in known if name not in {link.model for link in links}}
    for link in links:
        if link.robot in own:
            raise MessageError(
                f"joint_map gives {link.model} the name {link.robot}, which is that of another "
                f"joint; give {link.robot} a name too"
            )
    return joints


def _read_link(entry: str, known: Collection[str]) -> JointLink:
    parts = [part.strip() for part in entry.split(":")]
    if not 2 <= len(parts) <= 4 or not all(parts):
        raise MessageError(f"joint_map has {entry!r}; it must be {FORM}")
    if parts[0] not in known:
        raise MessageError(
            f"joint_map has joint {parts[0]!r}, which the model does not have; its joints are "
            f"{', '.join(known)}"
        )
    sign = _read_number(parts[2], entry) if len(parts) > 2 else 1.0
    offset = _read_number(parts[3], entry) if len(parts) > 3 else 0.0
    if abs(sign) != 1.0:
        raise MessageError(f"joint_map has sign {parts[2]} in {entry!r}; it must be 1 or -1")
    if not abs(offset) <= 2.0 * math.pi:
        raise MessageError(
            f"joint_map has offset {parts[3]} in {entry!r}; it must be an angle within 2 pi rad"
        )
    return JointLink(parts[0], parts[1], sign, offset)


def _read_number(text: str, entry: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise MessageError(
            f"joint_map has {text!r} in {entry!r}, which is no number; it must be {FORM}"
        ) from None
