"""The balance of a rover whose attitude, suspension and contact angles are measured, as rows.

The nine equations of `equilibrium` are kept in the form in which they are solved for what they
determine: six loads, two lateral terms and the pull of the last wheel as linear functions of how
much more each other wheel pulls than the last does. The wanted net traction enters as a force on
the centre of mass against the way the rover is to be pushed (d'Alembert), so that the tractions
together hold gravity and push by as much.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_physics.contact.contact_record import CONTACTS
from rover_physics.errors import ModelError
from rover_physics.forces.equilibrium import BALANCE, FREE_TORQUES, balance_forces
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place, place_masses
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover

WHEEL_COUNT = 6
FORCES = 2 * WHEEL_COUNT + 2
"""Tractions, loads and two lateral terms."""


@dataclass(frozen=True)
class MeasuredState:
    """What is measured of a rover at one moment."""

    roll: float
    """Roll in [rad]."""
    pitch: float
    """Pitch in [rad], positive with the nose down."""
    rocker_angle: float
    """Angle of the right rocker in [rad]; the left one's is the opposite."""
    bogie_angles: np.ndarray
    """(2,) angles of right and left bogie in [rad]."""
    contact_angles: np.ndarray
    """(6,) angles in [rad] from straight below a wheel to where it touches, positive in front."""
    contact_offsets: np.ndarray = field(default_factory=lambda: np.zeros(WHEEL_COUNT))
    """(6,) where each wheel touches along its axis, from its middle [m]."""


@dataclass(frozen=True, eq=False)
class BalanceRows:
    """Nine equations A x = b in x = tractions (6), loads (6), s0, s1, all in `force_unit`."""

    A: np.ndarray
    """(9, 14) coefficients, of order one."""
    b: np.ndarray
    """(9,) right-hand sides."""
    along: np.ndarray
    """(6,) places of the wheels along the body, in lengths of the rover: S_i = s0 + s1 along_i."""
    force_unit: float
    """A sixth of the weight in [N]."""

    @property
    def wheel_speeds(self) -> np.ndarray:
        """Speeds (6,) of the wheels' centres while the rover drives, relative to their mean.

        The last equation is that of virtual work: the tractions, each over the way that its wheel
        moves, lift and push the rover.
        """
        return WHEEL_COUNT * self.A[8, :WHEEL_COUNT]

    @property
    def equal_pull(self) -> float:
        """The traction of each wheel where all pull alike, in force units."""
        return float(self.b[8])

    def complete(self, tractions: np.ndarray) -> np.ndarray:
        """Return x (14,) that keeps all nine equations, with the differences between tractions.

        Args:
            tractions: (6,) in force units; what all have in common follows from the balance.
        """
        x = np.empty(FORCES)
        _complete(self.A, self.b, tractions, x)
        return x


ROWS_WORK = record_type(
    ("placement", PLACEMENT),
    ("contacts", CONTACTS),
    ("balance", BALANCE),
    ("pose", float, (3,)),
    ("q", float, (6,)),
    ("angles", float, (6,)),
    ("offsets", float, (6,)),
    ("push", float),
)
"""Work space of `BalanceWriter`."""
GIVEN = 6
"""Numbers of a state that are handed over together: attitude, suspension, push."""


class BalanceWriter:
    """Writes the balance of one rover, again and again, into its own work space."""

    def __init__(self, rover: Rover, payload: float | None = None):
        """Prepare for a rover.

        Args:
            rover: The rover, arm stowed.
            payload: Mass at the arm's tip [kg] instead of the rover's own.

        Raises:
            ModelError: A payload below zero, or for a rover without an arm.
        """
        mass, com = body_mass_and_com(rover, payload=payload)
        self._linkage = pack_linkage(rover, mass, com)
        self._linkage.has_tool_load = True
        self._linkage.tool[0] = _centre_of_mass(self._linkage)
        self._linkages, self._works = array_of(self._linkage), array_of(new_record(ROWS_WORK))
        self._given = np.zeros(GIVEN)
        self.weight = float(self._linkage.mass * self._linkage.gravity)
        """Weight of the rover with its payload in [N]."""

    def write(self, state: MeasuredState, net_traction: float) -> BalanceRows:
        """Return the balance at a measured state.

        Args:
            state: Attitude, suspension and contact angles.
            net_traction: Push along body +x in [N] beyond what holds the rover against gravity.

        Raises:
            ModelError: The equations do not determine the forces: the contact angles contradict
                one another so that the rover could not roll.
        """
        given = self._given
        given[0], given[1], given[2] = state.roll, state.pitch, state.rocker_angle
        given[3:5], given[5] = state.bogie_angles, net_traction
        A, b, along = np.zeros((9, FORCES)), np.empty(9), np.empty(6)
        angles, offsets = state.contact_angles, state.contact_offsets
        if not _write_state(self._linkages, self._works, given, angles, offsets, A, b, along):
            raise ModelError(
                f"contact angles {np.round(angles, 3).tolist()} rad leave the balance "
                "without a solution; they must be such that all wheels can roll at once"
            )
        return BalanceRows(A, b, along, self.weight / WHEEL_COUNT)


def _centre_of_mass(linkage: Any) -> np.ndarray:
    """Return the centre of mass (3,) of the whole rover on flat ground, body frame."""
    total = linkage.body_mass * linkage.body_com
    total = total + linkage.rocker_mass * linkage.rocker_coms.sum(axis=0)
    total = total + linkage.bogie_mass * linkage.bogie_coms.sum(axis=0)
    total = total + linkage.wheel_mass * linkage.wheels.sum(axis=0)
    return total / linkage.mass


@kernel
def _complete(A, b, tractions, x):
    """Write x (14,) that keeps all nine equations A x = b, with these differences of tractions."""
    for row in range(9):
        rest = b[row]
        for wheel in range(6):
            rest -= A[row, wheel] * (tractions[wheel] - tractions[5])
        if row < 8:
            x[6 + row] = rest
    for wheel in range(6):
        x[wheel] = tractions[wheel] - tractions[5] + rest


@kernel
def _write_state(linkages, works, given, angles, offsets, A, b, along):
    """Write the nine equations at a measured state; False where they are singular."""
    work = works[0]
    work.q[0], work.push = 0.0, given[5]
    for k in range(5):
        work.q[1 + k] = given[k]
    for wheel in range(6):
        work.angles[wheel], work.offsets[wheel] = angles[wheel], offsets[wheel]
    return _write_rows(linkages[0], work, A, b, along)


@kernel
def _write_rows(linkage, work, A, b, along):
    """Write the nine equations at what `work` was given; False where they are singular."""
    placement, contacts, balance = work.placement, work.contacts, work.balance
    linkage.tool[1, 0] = -work.push
    place(linkage, work.pose, work.q, placement)
    place_masses(linkage, work.q, placement)
    _write_contact(linkage.radius, placement, work.angles, work.offsets, contacts)
    if not balance_forces(linkage, placement, contacts, 1 + FREE_TORQUES, balance):
        return False
    for i in range(6):
        along[i] = 0.0
        for k in range(3):
            along[i] += placement.R[k, 0] * (placement.centres[i, k] - placement.origin[k])
        along[i] /= linkage.length
    span = along[2] - along[0]
    for column in range(1 + FREE_TORQUES):
        slope = (balance.lateral[2, column] - balance.lateral[0, column]) / span
        for row in range(9):
            if row < 6:
                value = balance.normal[row, column]
                A[row, 6 + row] = 1.0
            elif row == 6:
                value = balance.lateral[0, column] - slope * along[0]
                A[row, 12] = 1.0
            elif row == 7:
                value = slope
                A[row, 13] = 1.0
            else:
                value = balance.tangential[5, column]
            if column == 0:
                b[row] = 6.0 * value
            else:
                A[row, column - 1] = -value
                A[row, 5] += value
    A[8, 5] += 1.0
    return True


@kernel
def _write_contact(radius, placement, angles, offsets, contacts):
    """Write where wheels of known contact angles touch."""
    R, forward, up = placement.R, placement.forward, placement.up
    for wheel in range(6):
        s, c = np.sin(angles[wheel]), np.cos(angles[wheel])
        contacts.sine[wheel], contacts.cosine[wheel] = s, c
        for k in range(3):
            contacts.point[wheel, k] = (
                placement.centres[wheel, k]
                + radius * (s * forward[k] - c * up[k])
                + offsets[wheel] * R[k, 1]
            )
