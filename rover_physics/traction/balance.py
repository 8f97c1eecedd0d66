"""Equilibrium of a rover with measured attitude, suspension and contact angles, as rows of a QP.

The nine equations of `equilibrium` are solved for six loads, two lateral terms and the traction of
the last wheel, as linear functions of the other wheels' tractions relative to the last one. The
wanted push enters as d'Alembert's force, backward at the centre of mass. The tractions together
then hold the rover against gravity and add the push.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rover_physics.contact.contact_record import CONTACTS
from rover_physics.errors import ModelError
from rover_physics.forces.equilibrium import (
    BALANCE,
    FREE_TORQUES,
    solve_equations,
    write_equations,
)
from rover_physics.names import WHEEL_COUNT, WHEELS
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place, place_masses
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.traction.layout import (
    EQUATIONS,
    FORCES,
    LAST_WHEEL,
    LATERAL_SHARE,
    LATERAL_SHARE_EQUATION,
    LATERAL_SLOPE,
    LATERAL_SLOPE_EQUATION,
    LOAD,
    TRACTION,
    TRACTION_EQUATION,
    TRACTIONS,
)

FORCE_ROW, MOMENT_ROW = 0, 3
"""First row of the forces and of the moments in the equations of `equilibrium`."""
REAR, FRONT = WHEELS.index("rear_right"), WHEELS.index("front_right")
"""Two wheels whose lateral forces determine those of all wheels, which are linear along x."""


@dataclass(frozen=True)
class MeasuredState:
    """Measured state of a rover at one time."""

    roll: float
    """Roll in [rad]."""
    pitch: float
    """Pitch in [rad], positive with the nose down."""
    rocker_angle: float
    """Angle of the right rocker in [rad]; the left one has the opposite sign."""
    bogie_angles: np.ndarray
    """(2,) angles of right and left bogie in [rad]."""
    contact_angles: np.ndarray
    """(6,) angles from the lowest point of a wheel to its contact in [rad], positive in front."""
    contact_offsets: np.ndarray = field(default_factory=lambda: np.zeros(WHEEL_COUNT))
    """(6,) distances of the contacts from the wheels' middle planes, positive to the left [m]."""


MEASURED_BALANCE = record_type(
    ("A", float, (EQUATIONS, FORCES)),  # coefficients, of order 1
    ("b", float, (EQUATIONS,)),  # right-hand sides
    ("along", float, (WHEEL_COUNT,)),  # places of the wheels along the body, in rover lengths
    ("force_unit", float),  # a sixth of the weight [N]
)
"""The equations of `BalanceRows`, for kernels."""


@dataclass(frozen=True, eq=False)
class BalanceRows:
    """Nine equations A x = b with x = tractions (6), loads (6), s0, s1, all in `force_unit`.

    `layout` names the variables and equations.
    """

    packed: np.ndarray
    """Array (1,) of MEASURED_BALANCE."""

    @property
    def A(self) -> np.ndarray:  # noqa: N802
        """Coefficients (9, 14), of order 1."""
        return self.packed["A"][0]

    @property
    def b(self) -> np.ndarray:
        """Right-hand sides (9,)."""
        return self.packed["b"][0]

    @property
    def along(self) -> np.ndarray:
        """Positions (6,) of the wheels along the body, in rover lengths: S_i = s0 + s1 along_i.

        The rover length is from rear to front axle.
        """
        return self.packed["along"][0]

    @property
    def force_unit(self) -> float:
        """A sixth of the weight in [N]."""
        return float(self.packed["force_unit"][0])

    @property
    def wheel_speeds(self) -> np.ndarray:
        """Speeds (6,) of the wheels' centres over their mean while the rover drives.

        They are the coefficients of the traction equation, which is the principle of virtual work.
        """
        return WHEEL_COUNT * self.A[TRACTION_EQUATION, TRACTIONS]

    @property
    def equal_pull(self) -> float:
        """Traction of each wheel if all are equal, in force units."""
        return float(self.b[TRACTION_EQUATION])

    def complete(self, tractions: np.ndarray) -> np.ndarray:
        """Return x (14,) that keeps all nine equations and the differences between tractions.

        Args:
            tractions: (6,) in force units; their common part is replaced to keep the equations.
        """
        x = np.empty(FORCES)
        _complete(self.packed, tractions, x)
        return x

    def pull_equally(self) -> np.ndarray:
        """Return x (14,) that keeps all nine equations, with the same traction at all wheels."""
        return self.complete(np.zeros(WHEEL_COUNT))


MEASUREMENT = record_type(
    ("pose", float, (3,)),  # x, y [m] and yaw [rad], for `place`
    (
        "q",
        float,
        (6,),
    ),  # z [m], roll, pitch, right rocker, right and left bogie [rad], for `place`
    ("contact_angles", float, (WHEEL_COUNT,)),  # [rad]
    ("contact_offsets", float, (WHEEL_COUNT,)),  # [m]
    ("push", float),  # wanted push along body +x [N]
    ("resistance", float),  # resistance to the travel of the wheels [N]
)
"""A `MeasuredState` and the wanted push, for kernels; x, y, z and yaw are 0."""

BALANCE_WORK = record_type(
    ("measured", MEASUREMENT),
    ("com", float, (3,)),  # centre of mass of the whole rover on flat ground [m], body frame
    ("placement", PLACEMENT),
    ("contacts", CONTACTS),
    ("balance", BALANCE),
)
"""Input and work space of `BalanceWriter`."""


class BalanceWriter:
    """Writes the balance of one rover, repeatedly, into its own work space."""

    def __init__(self, rover: Rover, payload: float | None = None):
        """Prepare for a rover.

        Args:
            rover: The rover, arm stowed.
            payload: Mass at the arm's tip [kg] (default: that of the rover file).

        Raises:
            ModelError: A payload below 0, or for a rover without an arm.
        """
        mass, com = body_mass_and_com(rover, payload=payload)
        linkage = pack_linkage(rover, mass, com)
        self._linkages = array_of(linkage)
        self._works = array_of(new_record(BALANCE_WORK, com=_centre_of_mass(linkage)))
        # Views are kept because looking up a field of a record is as slow as writing it.
        measured = self._works["measured"]
        self._q, self._push = measured["q"][0], measured["push"]
        self._resistance = measured["resistance"]
        self._contact_angles = measured["contact_angles"][0]
        self._contact_offsets = measured["contact_offsets"][0]
        self.weight = float(linkage.mass * linkage.gravity)
        """Weight of the rover with its payload in [N]."""

    def write(
        self, state: MeasuredState, net_traction: float, resistance: float = 0.0
    ) -> BalanceRows:
        """Return the balance at a measured state.

        Args:
            state: Attitude, suspension and contact angles.
            net_traction: Push along body +x in [N], in addition to the force that holds the rover
                against gravity.
            resistance: Resistance to travel that the tractions overcome too, in [N]. A wheel's
                share is in proportion to its speed as all wheels roll.

        Raises:
            ModelError: The equations are singular: the contact angles contradict each other, so
                that the rover could not roll.
        """
        q = self._q
        q[1], q[2], q[3] = state.roll, state.pitch, state.rocker_angle
        q[4:] = state.bogie_angles
        self._contact_angles[:] = state.contact_angles
        self._contact_offsets[:] = state.contact_offsets
        self._push[0], self._resistance[0] = net_traction, resistance
        packed = np.zeros(1, MEASURED_BALANCE)
        if not _write_balance(self._linkages, self._works, packed):
            raise ModelError(
                f"contact angles {np.round(state.contact_angles, 3).tolist()} rad leave the "
                "balance without a solution; they must be such that all wheels can roll at once"
            )
        return BalanceRows(packed)


def _centre_of_mass(linkage: Any) -> np.ndarray:
    """Return the centre of mass (3,) [m] of the whole rover on flat ground, body frame."""
    total = linkage.body_mass * linkage.body_com
    total = total + linkage.rocker_mass * linkage.rocker_coms.sum(axis=0)
    total = total + linkage.bogie_mass * linkage.bogie_coms.sum(axis=0)
    total = total + linkage.wheel_mass * linkage.wheels.sum(axis=0)
    return total / linkage.mass


@kernel
def _complete(balances, tractions, x):
    """Write x (14,) that keeps all nine equations and the differences between tractions (6,)."""
    balance = balances[0]
    A, b = balance.A, balance.b
    last = tractions[LAST_WHEEL]
    for row in range(EQUATIONS):
        rest = b[row]
        for wheel in range(WHEEL_COUNT):
            rest -= A[row, TRACTION + wheel] * (tractions[wheel] - last)
        if row < TRACTION_EQUATION:
            x[LOAD + row] = rest
    for wheel in range(WHEEL_COUNT):
        x[TRACTION + wheel] = tractions[wheel] - last + rest


@kernel
def _write_balance(linkages, works, balances):
    """Write the nine equations at the state in `works`; return False if they are singular."""
    linkage, work, rows = linkages[0], works[0], balances[0]
    placement, balance, measured = work.placement, work.balance, work.measured
    columns = 1 + FREE_TORQUES
    place(linkage, measured.pose, measured.q, placement)
    place_masses(linkage, measured.q, placement)
    _write_contacts(linkage.radius, work)
    write_equations(linkage, placement, work.contacts, columns, balance)
    _add_push(linkage, work)
    if not solve_equations(columns, balance):
        return False
    rows.force_unit = linkage.mass * linkage.gravity / WHEEL_COUNT
    _write_places(linkage.length, placement, rows.along)
    _write_rows(balance, rows)
    _add_resistance(measured.resistance / rows.force_unit, rows)
    return True


@kernel
def _write_contacts(radius, work):
    """Write the contacts of wheels from their measured contact angles."""
    placement, contacts, measured = work.placement, work.contacts, work.measured
    for wheel in range(WHEEL_COUNT):
        axis, forward, up = placement.axis[wheel], placement.forward[wheel], placement.up[wheel]
        angle, offset = measured.contact_angles[wheel], measured.contact_offsets[wheel]
        s, c = np.sin(angle), np.cos(angle)
        contacts.sine[wheel], contacts.cosine[wheel] = s, c
        for k in range(3):
            contacts.point[wheel, k] = (
                placement.centres[wheel, k]
                + radius * (s * forward[k] - c * up[k])
                + offset * axis[k]
            )


@kernel
def _add_push(linkage, work):
    """Add d'Alembert's force of the wanted push to the right-hand sides of the equations.

    It acts on the body at the centre of mass, against the push: along body -x.
    """
    R, com, B = work.placement.R, work.com, work.balance.B
    weight = linkage.mass * linkage.gravity
    force = -work.measured.push
    moment_y, moment_z = com[2] * force, -com[1] * force
    for i in range(3):
        B[FORCE_ROW + i, 0] -= R[i, 0] * force / weight
        moment = R[i, 2] * moment_z + R[i, 1] * moment_y
        B[MOMENT_ROW + i, 0] -= moment / (weight * linkage.length)


@kernel
def _write_places(length, placement, along):
    """Write the positions (6,) of the wheels along the body, in rover lengths."""
    R, origin, centres = placement.R, placement.origin, placement.centres
    for wheel in range(WHEEL_COUNT):
        along[wheel] = 0.0
        for k in range(3):
            along[wheel] += R[k, 0] * (centres[wheel, k] - origin[k])
        along[wheel] /= length


@kernel
def _write_rows(balance, rows):
    """Write A x = b from the solved balance, whose forces are over the weight; A must be zeros."""
    A, b, along = rows.A, rows.b, rows.along
    span = along[FRONT] - along[REAR]
    for column in range(1 + FREE_TORQUES):
        slope = (balance.lateral[FRONT, column] - balance.lateral[REAR, column]) / span
        for row in range(EQUATIONS):
            if row < LATERAL_SHARE_EQUATION:
                value = balance.normal[row, column]
                A[row, LOAD + row] = 1.0
            elif row == LATERAL_SHARE_EQUATION:
                value = balance.lateral[REAR, column] - slope * along[REAR]
                A[row, LATERAL_SHARE] = 1.0
            elif row == LATERAL_SLOPE_EQUATION:
                value = slope
                A[row, LATERAL_SLOPE] = 1.0
            else:
                value = balance.tangential[LAST_WHEEL, column]
            if column == 0:
                b[row] = WHEEL_COUNT * value
            else:
                A[row, TRACTION + column - 1] = -value
                A[row, LAST_WHEEL] += value
    A[TRACTION_EQUATION, LAST_WHEEL] += 1.0


@kernel
def _add_resistance(resistance, rows):
    """Add what the tractions have to overcome at the wheels, in force units.

    The rest of the tractions keeps the balance, so that loads are those without resistance.
    """
    A, b = rows.A, rows.b
    for row in range(EQUATIONS):
        for wheel in range(WHEEL_COUNT):
            share = A[TRACTION_EQUATION, TRACTION + wheel]
            b[row] += resistance * share * A[row, TRACTION + wheel]
