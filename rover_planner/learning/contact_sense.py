# SPDX-License-Identifier: Apache-2.0
"""Forces of the wheels on the ground at one time: loads and shears from the model's balance.

The loads follow from the nine equations of `balance` with the measured torques, attitude and
suspension, at contacts from the map. Nothing of it needs the friction of the ground.
"""

from dataclasses import dataclass, replace

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traction.balance import BalanceWriter, MeasuredState
from rover_physics.traction.layout import LOADS, TRACTIONS
from rover_physics.traction.map_contacts import MapContactFinder
from rover_planner.learning.drive_log import (
    FORCES,
    PITCH,
    ROLL,
    STEERING,
    SUSPENSION,
    TORQUES,
    YAW,
    X,
    Y,
)

CLEAR = 0.08
"""Difference of a wheel's foremost and hindmost possible contact angle up to which its contact is
clear [rad]."""
STEEPEST = 0.55
"""Largest slope of a contact along the wheel's heading that is used [rad]."""


@dataclass(frozen=True, eq=False)
class WheelState:
    """Forces and frames of the wheels; all in the map frame, forces in N."""

    centres: Floats
    """(6, 3) wheel centres [m], z up to a constant."""
    along: Floats
    """(6, 3) directions forward along the ground."""
    axles: Floats
    """(6, 3) directions of the axles, to the left."""
    loads: Floats
    """(6,) normal forces."""
    doubts: Floats
    """(6,) errors of them, because it is not clear where the wheels touch."""
    tractions: Floats
    """(6,) measured torques over the radius; or what force sensors feel, as in the loads."""
    excess: float
    """Sum of the tractions beyond what holds the rover: resistance, acceleration, errors."""
    clear: Floats
    """(6,) 1 where a wheel has one clear contact, else 0."""
    links: Floats
    """(6,) angles of the links that carry the wheels, to the horizontal [rad], nose down."""
    steering: Floats
    """(6,) steering angles [rad]."""


class ContactSense:
    """Finds the wheel states of one rover on one map."""

    def __init__(self, rover: Rover, terrain: Terrain):
        """Prepare for a rover and a map."""
        self._radius, self._terrain = rover.wheel.radius, terrain
        self._balance = BalanceWriter(rover)
        self._finder = MapContactFinder(rover, terrain)
        self._linkages = array_of(pack_linkage(rover, *body_mass_and_com(rover)))
        self._placements = array_of(new_record(PLACEMENT))
        self._on_bogie = self._balance.on_bogie
        self.weight = self._balance.weight
        """Weight of the rover [N]."""

    def feel(self, row: Floats, forward: Floats) -> WheelState | None:
        """Return the state of the wheels at a row of measurements; None where it has none.

        Args:
            row: As in `drive_log`; torques and steering that were not measured count as 0.
            forward: (6,) 1 for wheels that roll forward, -1 for those that roll backward.
        """
        rocker = 0.5 * (row[SUSPENSION][0] - row[SUSPENSION][1])
        bogies = row[SUSPENSION][2:]
        steering, torques = np.nan_to_num(row[STEERING]), np.nan_to_num(row[TORQUES])
        q = np.array([0.0, row[ROLL], row[PITCH], rocker, *bogies])
        self._placements["steering"][0] = steering
        _place(self._linkages, self._placements, row[[X, Y, YAW]], q)
        placed = self._placements[0]
        centres = placed["centres"].copy()
        ground = self._terrain.elevation_at(centres[:, 0], centres[:, 1])
        height = float(np.median(ground - centres[:, 2])) + self._radius
        pose = np.array([row[X], row[Y], height, row[YAW]])
        level = np.zeros(WHEEL_COUNT)
        state = MeasuredState(row[ROLL], row[PITCH], rocker, bogies, level, steering=steering)
        try:
            ends = [self._finder.find(state, pose, 0.0, way).angles for way in (forward, -forward)]
            tractions = torques / self._radius
            (loads, excess), (other_loads, other_excess) = (
                self._balance_at(state, angles, tractions) for angles in ends
            )
        except ModelError:
            return None
        # Of what is between the two ends, the balance tells how the wheels touch.
        spread = excess - other_excess
        share = float(np.clip(-other_excess / spread, 0.0, 1.0)) if spread else 0.5
        doubts = 0.5 * np.abs(loads - other_loads)
        loads = share * loads + (1.0 - share) * other_loads
        excess = share * excess + (1.0 - share) * other_excess
        middle = share * ends[0] + (1.0 - share) * ends[1]
        s, c = np.sin(middle)[:, None], np.cos(middle)[:, None]
        sides = np.repeat([rocker, -rocker], 3)
        links = row[PITCH] + sides + np.where(self._on_bogie, np.repeat(bogies, 3), 0.0)
        along = s * placed["up"] + c * placed["forward"]
        clear = (np.abs(ends[0] - ends[1]) < CLEAR) & (np.abs(along[:, 2]) < np.sin(STEEPEST))
        felt = row[FORCES].reshape(WHEEL_COUNT, 3)
        if np.isfinite(felt).any():
            # from the frame of the link to that of the contact, turned about the axle
            turn = np.arcsin(along[:, 2]) + links
            c, s = np.cos(turn), np.sin(turn)
            tractions = np.where(
                np.isfinite(felt[:, 0]), c * felt[:, 0] + s * felt[:, 2], tractions
            )
            loads = np.where(
                np.isfinite(felt[:, 2]), c * felt[:, 2] - s * np.nan_to_num(felt[:, 0]), loads
            )
        return WheelState(
            centres=centres,
            along=along,
            axles=placed["axis"].copy(),
            loads=loads,
            doubts=doubts,
            tractions=tractions,
            excess=excess,
            clear=clear.astype(float),
            links=links,
            steering=steering,
        )

    def _balance_at(
        self, state: MeasuredState, angles: Floats, tractions: Floats
    ) -> tuple[Floats, float]:
        """Return loads (6,), and the tractions' excess, at contact angles."""
        balance = self._balance.write(replace(state, contact_angles=angles), 0.0)
        unit = balance.force_unit
        forces = balance.complete(tractions / unit)
        excess = float((balance.directions * (tractions - unit * forces[TRACTIONS])).sum())
        return unit * forces[LOADS], excess


@kernel
def _place(linkages, placements, pose, q):
    place(linkages[0], pose, q, placements[0])
