# SPDX-License-Identifier: Apache-2.0
"""Status codes of poses and bounds, and torque policies, for kernels and results."""

from enum import IntEnum


class PoseStatus(IntEnum):
    """How far a pose, or the contact of a wheel, could be evaluated, and what stopped it."""

    SETTLED = 0
    """All six wheels touch the ground, and the forces balance; a wheel is over known ground."""
    OFF_MAP = 1
    """A wheel would be beyond the edge of the map."""
    UNKNOWN_GROUND = 2
    """A wheel would be over ground of unknown height."""
    NOT_SETTLED = 3
    """No configuration was found in which all six wheels touch the ground."""
    NO_EQUILIBRIUM = 4
    """The equilibrium equations are singular."""
    NOT_COMPUTABLE = 5
    """A force, torque or margin is NaN or infinite."""
    STEERING = 6
    """A wheel cannot point where the motion of the body asks."""


class BoundStatus(IntEnum):
    """Result of bounding a pose on an uncertain map."""

    BOUNDED = 0
    """Bounds were found."""
    OFF_MAP_NEAR = 1
    """The edge of the map is within reach of a wheel."""
    UNKNOWN_NEAR = 2
    """Unknown ground is within reach of a wheel."""
    NOT_SETTLED = 3
    """The pose itself is not settled."""
    SINGULAR = 4
    """The forces are not determined."""
    ON_EDGE = 5
    """A wheel may climb an edge or fall off it."""


class TorquePolicy(IntEnum):
    """Distribution of the traction among the wheels, numbered as in `names.TORQUE_POLICIES`."""

    EQUAL = 0
    """Equal traction on all wheels."""
    SERVO = 1
    """Torques of speed servos at the rate of the commanded motion."""
    OPTIMAL = 2
    """The torques that need the least friction, as traction control can apply them."""


class Stall(IntEnum):
    """What else than sliding wheels stops a rover; under torque policies only a wedged wheel."""

    NONE = 0
    """Nothing: the rover drives, or its wheels slide."""
    STALLED = 1
    """The motors stall at their largest torque."""
    WEDGED = 2
    """A wheel is wedged between faces in front and behind."""
    RUNS_AWAY = 3
    """The motors cannot hold the rover at their largest torque."""
