# SPDX-License-Identifier: Apache-2.0
"""Forces of the wheels on the ground at one time: loads and shears from the model's balance.

The loads follow from the nine equations of `balance` with the measured torques, attitude and
suspension, at contacts from the map. Nothing of it needs the friction of the ground.
"""

from typing import Any

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.rover.linkage import place, rocker_sign
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import look_up, pack_ground
from rover_physics.traction.balance import (
    EQUATIONS,
    FORCES,
    LOAD,
    TRACTION,
    BalanceWriter,
    complete_forces,
    write_balance,
)
from rover_physics.traction.map_contacts import MAP_SEARCH, find_contacts, median_of_wheels
from rover_planner.learning import drive_log
from rover_planner.learning.drive_log import PITCH, ROLL, YAW, X, Y

CLEAR = 0.08
"""Difference of a wheel's foremost and hindmost possible contact angle up to which its contact is
clear [rad]."""
STEEPEST = 0.55
"""Largest slope of a contact along the wheel's heading that is used [rad]."""
_SUSPENSION, _TORQUES, _STEERING, _FORCES = (
    columns.start
    for columns in (
        drive_log.SUSPENSION, drive_log.TORQUES, drive_log.STEERING, drive_log.FORCES,
    )
)  # fmt: skip

WHEEL_STATE = record_type(
    ("centres", float, (WHEEL_COUNT, 3)),  # wheel centres [m], z up to a constant
    ("along", float, (WHEEL_COUNT, 3)),  # directions forward along the ground
    ("axles", float, (WHEEL_COUNT, 3)),  # directions of the axles, to the left
    ("loads", float, (WHEEL_COUNT,)),  # normal forces [N]
    ("doubts", float, (WHEEL_COUNT,)),  # their errors as it is not clear where wheels touch [N]
    # measured torques over the radius, or what force sensors feel, as in the loads [N]
    ("tractions", float, (WHEEL_COUNT,)),
    ("excess", float),  # sum of tractions beyond what holds the rover: resistance, errors [N]
    ("clear", float, (WHEEL_COUNT,)),  # 1 where a wheel has one clear contact, else 0
    ("links", float, (WHEEL_COUNT,)),  # angles of the links of wheels [rad], nose down
    ("steering", float, (WHEEL_COUNT,)),  # steering angles [rad]
)
"""Forces and frames of the wheels, map frame."""

_SENSE = record_type(
    ("ends", float, (2, WHEEL_COUNT)),  # foremost and hindmost contact angles [rad]
    ("loads", float, (2, WHEEL_COUNT)),  # with these [N]
    ("excess", float, (2,)),  # with these [N]
    # the balance: the fields of `BalanceRows`, and its solution
    ("A", float, (EQUATIONS, FORCES)),
    ("b", float, (EQUATIONS,)),
    ("lateral_shares", float, (WHEEL_COUNT, 2)),
    ("directions", float, (WHEEL_COUNT,)),
    ("force_unit", float),
    ("tractions", float, (WHEEL_COUNT,)),
    ("forces", float, (FORCES,)),
    ("state", WHEEL_STATE),
)
"""Work space and result."""


class ContactSense:
    """Finds the wheel states of one rover on one map."""

    def __init__(self, rover: Rover, terrain: Terrain):
        """Prepare for a rover and a map."""
        balance, self._ground = BalanceWriter(rover), pack_ground(terrain)
        self.weight = balance.weight
        """Weight of the rover [N]."""
        unit = self.weight / WHEEL_COUNT
        self._senses = array_of(new_record(_SENSE, force_unit=unit))
        searches = array_of(new_record(MAP_SEARCH))
        arrays = self._ground.records, balance.linkages, searches, balance.works, self._senses
        self._arrays = arrays

    def feel(self, row: Floats, forward: Floats) -> Any:
        """Return the WHEEL_STATE at a row of measurements; None where it has none.

        Args:
            row: As in `drive_log`; torques and steering that were not measured count as 0.
            forward: (6,) 1 for wheels that roll forward, -1 for those that roll backward.
        """
        return self._senses["state"].copy()[0] if _feel(*self._arrays, row, forward) else None


@kernel
def _feel(grounds, linkages, searches, works, senses, row, forward):
    """Write the state of the wheels; return False off the map or without a balance."""
    ground, linkage, search = grounds[0], linkages[0], searches[0]
    sense, state = senses[0], senses[0].state
    _take_pose(row, forward, search)
    _find_height(ground, linkage, search, sense)
    find_contacts(grounds, linkages, searches)
    for wheel in range(WHEEL_COUNT):
        sense.ends[0, wheel] = search.angles[wheel]
        sense.ends[1, wheel] = search.hindmost[wheel]
        if not np.isfinite(search.angles[wheel]):
            return False
        torque = row[_TORQUES + wheel]
        state.tractions[wheel] = torque / linkage.radius if np.isfinite(torque) else 0.0
    for end in range(2):
        if not _balance_at(end, linkages, search, works, sense):
            return False
    share = _weigh_ends(sense)
    state.excess = share * sense.excess[0] + (1.0 - share) * sense.excess[1]
    for wheel in range(WHEEL_COUNT):
        _write_wheel(wheel, share, row, linkage, search, sense)
    return True


@kernel
def _take_pose(row, forward, search):
    """Take what was measured of the pose; the height is 0."""
    pose, q = search.pose, search.q
    pose[0], pose[1], pose[2] = row[X], row[Y], row[YAW]
    q[0], q[1], q[2] = 0.0, row[ROLL], row[PITCH]
    q[3] = 0.5 * (row[_SUSPENSION] - row[_SUSPENSION + 1])
    q[4], q[5] = row[_SUSPENSION + 2], row[_SUSPENSION + 3]
    for wheel in range(WHEEL_COUNT):
        angle = row[_STEERING + wheel]
        search.placement.steering[wheel] = angle if np.isfinite(angle) else 0.0
        search.directions[wheel] = forward[wheel]


@kernel
def _find_height(ground, linkage, search, sense):
    """Write the height at which half of the wheels are over the ground below their centres."""
    placement, heights = search.placement, sense.tractions
    place(linkage, search.pose, search.q, placement)
    for wheel in range(WHEEL_COUNT):
        centre = placement.centres[wheel]
        heights[wheel] = look_up(ground, centre[0], centre[1])[0] - centre[2]
    search.q[0] = median_of_wheels(heights) + linkage.radius


@kernel
def _balance_at(end, linkages, search, works, sense):
    """Write loads and excess at one end of the contact angles; return whether there are any."""
    work, state, A, unit = works[0], sense.state, sense.A, sense.force_unit
    measured = work.measured
    measured.push = measured.resistance = measured.q[0] = 0.0
    for k in range(1, 6):
        measured.q[k] = search.q[k]
    for wheel in range(WHEEL_COUNT):
        measured.contact_angles[wheel] = sense.ends[end, wheel]
        measured.steering[wheel] = search.placement.steering[wheel]
        measured.loads[wheel] = 1.0
        sense.tractions[wheel] = state.tractions[wheel] / unit
    for i in range(EQUATIONS):
        sense.b[i] = 0.0
        for k in range(FORCES):
            A[i, k] = 0.0
    if not write_balance(linkages, works, sense):
        return False
    complete_forces(A, sense.b, sense.directions, sense.tractions, sense.forces)
    sense.excess[end] = 0.0
    for wheel in range(WHEEL_COUNT):
        sense.loads[end, wheel] = unit * sense.forces[LOAD + wheel]
        beyond = state.tractions[wheel] - unit * sense.forces[TRACTION + wheel]
        sense.excess[end] += sense.directions[wheel] * beyond
    return True


@kernel
def _weigh_ends(sense):
    """Return the share of the foremost contacts: the balance tells where between wheels touch."""
    spread = sense.excess[0] - sense.excess[1]
    if spread == 0.0:
        return 0.5
    return min(max(-sense.excess[1] / spread, 0.0), 1.0)


@kernel
def _write_wheel(wheel, share, row, linkage, search, sense):
    """Write frame and forces of a wheel, with a share of its foremost contact."""
    state, placement, q = sense.state, search.placement, search.q
    first, last = sense.ends[0, wheel], sense.ends[1, wheel]
    middle = share * first + (1.0 - share) * last
    s, c = np.sin(middle), np.cos(middle)
    for k in range(3):
        state.centres[wheel, k] = placement.centres[wheel, k]
        state.axles[wheel, k] = placement.axis[wheel, k]
        state.along[wheel, k] = s * placement.up[wheel, k] + c * placement.forward[wheel, k]
    side = wheel // (WHEEL_COUNT // 2)
    link = q[2] + rocker_sign(side) * q[3]
    if linkage.on_bogie[wheel]:
        link += q[4 + side]
    rise = state.along[wheel, 2]
    is_clear = abs(first - last) < CLEAR and abs(rise) < np.sin(STEEPEST)
    state.links[wheel], state.steering[wheel] = link, placement.steering[wheel]
    state.clear[wheel] = 1.0 if is_clear else 0.0
    loads = sense.loads[0, wheel], sense.loads[1, wheel]
    state.doubts[wheel] = 0.5 * abs(loads[0] - loads[1])
    state.loads[wheel] = share * loads[0] + (1.0 - share) * loads[1]
    # Felt forces turn about the axle, from the frame of the link to that of the contact.
    turn = np.arcsin(rise) + link
    s, c = np.sin(turn), np.cos(turn)
    ahead, up = row[_FORCES + 3 * wheel], row[_FORCES + 3 * wheel + 2]
    if np.isfinite(ahead):
        state.tractions[wheel] = c * ahead + s * up
    if np.isfinite(up):
        state.loads[wheel] = c * up - s * (ahead if np.isfinite(ahead) else 0.0)
