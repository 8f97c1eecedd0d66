"""What given wheel torques do to a rover on its ground: tractions, loads, and the push left."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import ModelError
from rover_physics.names import SIDES, WHEEL_COUNT, WHEELS
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.traction.balance import BalanceWriter, MeasuredState
from rover_physics.traction.layout import LATERAL_SHARE, LATERAL_SLOPE, LOADS, TRACTIONS

ROUNDS = 6
"""Rounds in which loads and tractions are found from each other: friction links them."""
MIN_CAPACITY = 1e-9
"""Smallest friction force that a utilisation is a share of [N]: unloaded wheels have none."""


@dataclass(frozen=True, eq=False)
class DrivingForces:
    """The forces of a rover that moves, or stays, under given torques."""

    push: float
    """Force along body +x beyond what holds the rover where it is [N]."""
    tractions: Floats
    """(6,) along the ground, forward, within the friction of each wheel [N]."""
    loads: Floats
    """(6,) normal forces, none below 0: ground does not pull [N]."""
    utilisation: Floats
    """(6,) share of the friction that is used; 1 where a wheel slides."""
    sliding: NDArray[np.bool_]
    """(6,) True where the motor pulls more than friction holds."""

    def name_sliding(self) -> str:
        """Return the names of the wheels that slide, with a comma between."""
        return ", ".join(name for name, slides in zip(WHEELS, self.sliding, strict=True) if slides)


def find_driving_forces(
    writer: BalanceWriter, radius: float, here: PathPrediction, torques: Floats, direction: float
) -> DrivingForces:
    """Find the forces under given torques, by d'Alembert: the push accelerates the rover's mass.

    Args:
        writer: Writes the balance of the rover.
        radius: Wheel radius [m].
        here: One waypoint: where the rover is.
        torques: (6,) of the motors [N m], positive forward.
        direction: 1 where the rover moves forward, -1 backward, 0 where it rests.

    Returns:
        The forces; no push and the loads of `here` where the balance does not determine them.
    """
    friction, loads, lateral = here.friction[0], here.wheel_loads[0], here.lateral[0]
    resistance = np.nan_to_num(here.motion_resistance[0])
    wanted = torques / radius - direction * resistance
    state = _measure_state(here)
    tractions, push, sliding = wanted, 0.0, np.zeros(WHEEL_COUNT, dtype=bool)
    for _ in range(ROUNDS):
        loads = np.maximum(loads, 0.0)
        limit = np.sqrt(np.clip((friction * loads) ** 2 - lateral**2, 0.0, None))
        sliding = np.abs(wanted) > limit
        tractions = np.clip(wanted, -limit, limit)
        try:
            rows = writer.write(state, push)
        except ModelError:
            return DrivingForces(0.0, tractions, loads, here.friction_utilisation[0], sliding)
        x = rows.complete(tractions / rows.force_unit) * rows.force_unit
        push += float((tractions - x[TRACTIONS]).sum())
        loads, lateral = x[LOADS], x[LATERAL_SHARE] + x[LATERAL_SLOPE] * rows.along
    loads = np.maximum(loads, 0.0)
    used = np.hypot(tractions, lateral) / np.maximum(friction * loads, MIN_CAPACITY)
    if not direction:  # soil gives way only to what is more than its resistance
        push = float(np.sign(push) * max(abs(push) - resistance.sum(), 0.0))
    utilisation = np.where(sliding, 1.0, np.minimum(used, 1.0))
    return DrivingForces(push, tractions, loads, utilisation, sliding)


def _measure_state(here: PathPrediction) -> MeasuredState:
    """Return what would be measured of the rover at the waypoint, contacts included."""
    offsets = (here.contact_points[0] - here.wheel_centres[0]) @ _find_wheel_axis(here)
    return MeasuredState(
        float(here.roll[0]), float(here.pitch[0]), float(here.rocker_angle[0, 0]),
        here.bogie_angle[0], here.contact_angle[0], offsets,
    )  # fmt: skip


def _find_wheel_axis(here: PathPrediction) -> Floats:
    """Return the direction (3,) of the wheel axes, right to left, map frame."""
    right, left = here.wheel_centres[0].reshape(len(SIDES), -1, 3).mean(axis=1)
    return np.asarray((left - right) / np.linalg.norm(left - right))
