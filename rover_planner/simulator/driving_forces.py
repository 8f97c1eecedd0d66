"""What given wheel torques do to a rover on its ground: tractions, loads, and the push left."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import ModelError
from rover_physics.names import WHEELS
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.traction.balance import BalanceWriter, MeasuredState

Floats = NDArray[np.float64]
ROUNDS = 6
"""Loads hang on tractions, and by friction tractions on loads: so often each follows the other."""


@dataclass(frozen=True, eq=False)
class DrivingForces:
    """The forces of a rover that moves, or stays, under given torques."""

    push: float
    """Force along the way beyond what holds the rover where it is [N]."""
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
    writer: BalanceWriter, radius: float, here: PathPrediction, torques: Floats, moving: float
) -> DrivingForces:
    """Find the forces under given torques, by d'Alembert: the push is held by the rover's mass.

    Args:
        writer: Of the rover.
        radius: Of its wheels [m].
        here: One row: where the rover is.
        torques: (6,) of the motors [N m], positive forward.
        moving: 1 where it moves forward, -1 backward, 0 where it rests.

    Returns:
        The forces; no push and those of `here` where the balance does not determine them.
    """
    friction, loads, lateral = here.friction[0], here.wheel_loads[0], here.lateral[0]
    resistance = np.nan_to_num(here.motion_resistance[0])
    wanted = torques / radius - moving * resistance
    state = _state(here)
    tractions, push, sliding = wanted, 0.0, np.zeros(len(WHEELS), dtype=bool)
    for _ in range(ROUNDS):
        loads = np.maximum(loads, 0.0)
        most = np.sqrt(np.clip((friction * loads) ** 2 - lateral**2, 0.0, None))
        sliding = np.abs(wanted) > most
        tractions = np.clip(wanted, -most, most)
        try:
            rows = writer.write(state, push)
        except ModelError:
            return DrivingForces(0.0, tractions, loads, here.friction_utilisation[0], sliding)
        held = rows.complete(tractions / rows.force_unit) * rows.force_unit
        push += float((tractions - held[:6]).sum())
        loads, lateral = held[6:12], held[12] + held[13] * rows.along
    loads = np.maximum(loads, 0.0)
    used = np.hypot(tractions, lateral) / np.maximum(friction * loads, 1e-9)
    if not moving:  # soil gives way only to what is more than its resistance
        push = float(np.sign(push) * max(abs(push) - resistance.sum(), 0.0))
    return DrivingForces(push, tractions, loads, np.where(sliding, 1.0, np.minimum(used, 1.0)),
                         sliding)  # fmt: skip


def _state(here: PathPrediction) -> MeasuredState:
    """Return what would be measured of the rover there, contacts included."""
    offsets = (here.contact_points[0] - here.wheel_centres[0]) @ _axis(here)
    return MeasuredState(
        float(here.roll[0]), float(here.pitch[0]), float(here.rocker_angle[0, 0]),
        here.bogie_angle[0], here.contact_angle[0], offsets,
    )  # fmt: skip


def _axis(here: PathPrediction) -> Floats:
    """Return the direction (3,) of the wheel axes, map frame."""
    left = here.wheel_centres[0, 3:].mean(axis=0)
    right = here.wheel_centres[0, :3].mean(axis=0)
    return np.asarray((left - right) / np.linalg.norm(left - right))
