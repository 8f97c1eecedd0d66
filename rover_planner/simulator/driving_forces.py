# SPDX-License-Identifier: Apache-2.0
"""Computes the forces on a rover under given wheel torques: net push and use of friction."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import ModelError
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.records import new_record
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.linkage import PLACEMENT, place
from rover_physics.traction.balance import LOADS, TRACTIONS, BalanceWriter, MeasuredState

ROUNDS = 6
"""Fixed-point iterations of loads and tractions, which depend on each other by friction."""
MIN_CAPACITY = 1e-9
"""Lower bound of a wheel's friction force [N]; avoids a division by zero at unloaded wheels."""


@dataclass(frozen=True, eq=False)
class DrivingForces:
    """The forces on a rover, moving or at rest, under given torques."""

    push: float
    """Net force along the rolling motion of the wheels that accelerates the rover [N]."""
    utilisation: Floats
    """(6,) friction utilisation; 1 for a sliding wheel."""
    sliding: NDArray[np.bool_]
    """(6,) True if the motor's force exceeds the friction limit."""


def find_driving_forces(
    writer: BalanceWriter, radius: float, here: PathPrediction, torques: Floats, direction: float
) -> DrivingForces:
    """Compute the forces under given torques; by d'Alembert the push accelerates the rover's mass.

    Args:
        writer: Writes the balance of the rover.
        radius: Wheel radius [m].
        here: Prediction of one waypoint, the rover's pose.
        torques: (6,) motor torques [N m], positive forward.
        direction: 1 if the rover moves along the rolling motion of the wheels, -1 against it, 0 at
            rest.

    Returns:
        The forces; zero push and the utilisation of `here` if the balance has no unique solution.
    """
    friction, loads, lateral = here.friction[0], here.wheel_loads[0], here.lateral[0]
    resistance = np.nan_to_num(here.motion_resistance[0])
    state = measure_state(here, writer.linkages[0])
    rolls = direction * writer.find_rolling(state).directions
    wanted = torques / radius - rolls * resistance
    push = 0.0
    for _ in range(ROUNDS):
        loads = np.maximum(loads, 0.0)
        limit = np.sqrt(np.clip((friction * loads) ** 2 - lateral**2, 0.0, None))
        sliding = np.abs(wanted) > limit
        tractions = np.clip(wanted, -limit, limit)
        try:
            rows = writer.write(state, push)
        except ModelError:
            return DrivingForces(0.0, here.friction_utilisation[0], sliding)
        x = rows.complete(tractions / rows.force_unit) * rows.force_unit
        push += float((rows.directions * (tractions - x[TRACTIONS])).sum())
        loads, lateral = x[LOADS], rows.lateral_forces(x)
    loads = np.maximum(loads, 0.0)
    used = np.hypot(tractions, lateral) / np.maximum(friction * loads, MIN_CAPACITY)
    if not direction:  # at rest, a push below the soil's resistance has no effect
        push = float(np.sign(push) * max(abs(push) - resistance.sum(), 0.0))
    utilisation = np.where(sliding, 1.0, np.minimum(used, 1.0))
    return DrivingForces(push, utilisation, sliding)


def measure_state(here: PathPrediction, linkage: Any) -> MeasuredState:
    """Return the measured state of a rover, a LINKAGE, at the waypoint with its contacts."""
    arms = here.contact_points[0] - here.wheel_centres[0]
    return MeasuredState(
        float(here.roll[0]), float(here.pitch[0]), float(here.rocker_angle[0, 0]),
        here.bogie_angle[0], here.contact_angle[0],
        np.sum(arms * find_axles(linkage, here), axis=1), here.steering_angle[0],
        here.wheel_loads[0],
    )  # fmt: skip


def find_axles(linkage: Any, here: PathPrediction) -> Floats:
    """Return the directions (6, 3) of the axles of a LINKAGE, positive to the left, map frame."""
    placement = new_record(PLACEMENT, steering=here.steering_angle[0])
    place(linkage, here.poses[0], here.results["q"][0], placement)
    return np.asarray(placement.axis)
