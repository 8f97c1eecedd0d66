# SPDX-License-Identifier: Apache-2.0
"""Equilibrium of a rover with measured attitude, suspension and contact angles, as rows of a QP.

The nine equations of `equilibrium` are solved for six loads, two lateral terms and the traction of
the last wheel, as linear functions of the other wheels' tractions relative to the last one. The
wanted push enters as d'Alembert's force, backward at the centre of mass. The tractions together
then hold the rover against gravity and add the push.

Wheels may be turned. They then roll along the motion of ROLLING: tractions count along the
wheels' own headings, "equal" ones have the sign with which each wheel rolls in this motion, and a
push accelerates the rover along it. A push is a generalised force: its work per mean distance that
the wheels roll.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from rover_physics.contact.contact_record import CONTACTS, write_point
from rover_physics.errors import ModelError
from rover_physics.forces.equilibrium import (
    BALANCE,
    FREE_TORQUES,
    add_body_load,
    solve_equations,
    write_equations,
)
from rover_physics.forces.shares import has_turned_wheels, place_of, write_shares
from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place, place_masses
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover

# Indices of the forces x and of their equations. After the "first of" some, the entries of the six
# wheels follow in wheel order: `x[LOAD + wheel]`.
LAST_WHEEL = WHEEL_COUNT - 1
"""The wheel whose traction follows from the balance and the other wheels' differences to it."""

# Variables; those of the traction control's program begin with them.
TRACTION = 0
"""First of the tractions T (6): forces along the ground in the wheels' headings."""
LOAD = TRACTION + WHEEL_COUNT
"""First of the wheel loads N (6): forces normal to the ground, positive if the ground pushes."""
LATERAL_SHARE = LOAD + WHEEL_COUNT
"""s0 of the lateral forces; straight ahead it is the same for all wheels."""
LATERAL_SLOPE = LATERAL_SHARE + 1
"""s1 of the lateral forces; straight ahead their change along the body per rover length."""
FORCES = LATERAL_SLOPE + 1
"""Number of forces: tractions, loads and the two lateral terms."""
TRACTIONS = slice(TRACTION, TRACTION + WHEEL_COUNT)
"""The six tractions."""
LOADS = slice(LOAD, LOAD + WHEEL_COUNT)
"""The six loads."""

# Equations of the balance. Each but the last determines a force: the one at LOAD + its number.
TRACTION_EQUATION = FORCES - LOAD
"""The equation that determines the traction of LAST_WHEEL, by the principle of virtual work."""
EQUATIONS = TRACTION_EQUATION + 1
"""Number of equations of the balance."""

LEAST_LOAD = 0.1
"""Smallest load over the mean load by which a wheel shares lateral forces."""


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
    steering: np.ndarray = field(default_factory=lambda: np.zeros(WHEEL_COUNT))
    """(6,) steering angles in [rad], positive to the left."""
    loads: np.ndarray = field(default_factory=lambda: np.ones(WHEEL_COUNT))
    """(6,) loads, in any unit, to which the lateral forces are in proportion."""


class BalanceRows(NamedTuple):
    """Nine equations A x = b with x = tractions (6), loads (6), s0, s1, all in `force_unit`.

    TRACTION and the constants after it name the variables and equations.
    """

    A: Floats
    """(9, 14) coefficients, of order 1."""
    b: Floats
    """(9,) right-hand sides."""
    lateral_shares: Floats
    """Shares (6, 2) of the wheels in the lateral terms: S_i = s0 share_i0 + s1 share_i1.

    With wheels straight ahead they are the wheel's load over the mean load, and that times its
    position along the body in rover lengths, from rear to front axle.
    """
    directions: Floats
    """(6,) 1 where a wheel rolls forward, -1 where backward."""
    force_unit: float
    """A sixth of the weight in [N]."""

    def lateral_forces(self, x: np.ndarray) -> np.ndarray:
        """Return the lateral forces (6,) of x (14,), in its unit."""
        shares = self.lateral_shares
        return x[LATERAL_SHARE] * shares[:, 0] + x[LATERAL_SLOPE] * shares[:, 1]

    @property
    def wheel_speeds(self) -> np.ndarray:
        """Speeds (6,) of the wheels' centres along their headings while the rover drives.

        They are over the mean of all wheels' speeds in their `directions`. They are the
        coefficients of the traction equation, which is the principle of virtual work.
        """
        return WHEEL_COUNT * self.A[TRACTION_EQUATION, TRACTIONS]

    def complete(self, tractions: np.ndarray) -> np.ndarray:
        """Return x (14,) that keeps all nine equations and the differences between tractions.

        Args:
            tractions: (6,) in force units; their common part, along `directions`, is replaced to
                keep the equations.
        """
        x = np.empty(FORCES)
        complete_forces(self.A, self.b, self.directions, tractions, x)
        return x

    def pull_equally(self) -> np.ndarray:
        """Return x (14,) that keeps all nine equations, with the same traction at all wheels."""
        return self.complete(np.zeros(WHEEL_COUNT))


MEASUREMENT = record_type(
    ("q", float, (6,)),  # z [m], roll, pitch, right rocker, right and left bogie [rad]
    ("contact_angles", float, (WHEEL_COUNT,)),  # [rad]
    ("contact_offsets", float, (WHEEL_COUNT,)),  # [m]
    ("steering", float, (WHEEL_COUNT,)),  # [rad]
    ("loads", float, (WHEEL_COUNT,)),  # in any unit
    ("push", float),  # wanted push along the motion of ROLLING [N]
    ("resistance", float),  # resistance to the travel of the wheels [N]
)
"""A `MeasuredState` and the wanted push, for kernels; z is 0."""

ROLLING = record_type(
    ("motion", float, (3,)),  # speed ahead, to the left, yaw rate per mean wheel speed [1, 1, 1/m]
    ("directions", float, (WHEEL_COUNT,)),  # 1 where a wheel rolls forward, -1 where backward
    ("speeds", float, (WHEEL_COUNT,)),  # along the headings on level ground, over the mean speed
    ("thrust", float, (3,)),  # force at the centre of mass and moment of a unit push [1, 1, m]
    ("inertia", float),  # push over acceleration of the mean wheel speed, over the rover's mass
    ("arms", float, (WHEEL_COUNT,)),  # moment about body z per traction [m], positive to the left
)
"""The motion in which the wheels roll with their steering angles.

It is that of `shares`, scaled so that the mean speed of the wheels along their headings is 1. It
goes forward, or to the left if it is mostly a turn. Wheels straight ahead have the motion (1, 0,
0)."""

BALANCE_WORK = record_type(
    ("measured", MEASUREMENT),
    ("pose", float, (3,)),  # x, y [m] and yaw [rad], all 0
    ("com", float, (3,)),  # centre of mass of the whole rover on flat ground [m], body frame
    ("placement", PLACEMENT),
    ("contacts", CONTACTS),
    ("balance", BALANCE),
    ("rolling", ROLLING),
    ("load", float, (3, 3)),  # the push as a load on the body, as for `add_body_load`
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
        self.linkages = array_of(linkage)
        """(1,) the rover's LINKAGE, for kernels."""
        self.works = array_of(new_record(BALANCE_WORK, com=_centre_of_mass(linkage)))
        """(1,) BALANCE_WORK, for kernels."""
        self.weight = float(linkage.mass * linkage.gravity)
        """Weight of the rover with its payload in [N]."""
        self.on_bogie = np.array(linkage.on_bogie, dtype=bool)
        """(6,) whether each wheel hangs on a bogie."""

    def find_rolling(self, state: MeasuredState) -> Any:
        """Return how the wheels roll at a measured state, without its contacts: a ROLLING."""
        self._take(state)
        _place_wheels(self.linkages, self.works)
        return self.works["rolling"].copy()[0]

    def _take(self, state: MeasuredState, push: float = 0.0, resistance: float = 0.0) -> None:
        q = 0.0, state.roll, state.pitch, state.rocker_angle, *state.bogie_angles
        contacts = state.contact_angles, state.contact_offsets
        wheels = state.steering, state.loads
        self.works["measured"][0] = q, *contacts, *wheels, push, resistance

    def find_loads(self, state: MeasuredState) -> Floats:
        """Return the loads (6,) [N] of equal torques that hold the rover at a measured state.

        Raises:
            ModelError: As `write`.
        """
        rows = self.write(state, 0.0)
        return np.asarray(rows.force_unit * rows.pull_equally()[LOADS])

    def write(
        self, state: MeasuredState, net_traction: float, resistance: float = 0.0
    ) -> BalanceRows:
        """Return the balance at a measured state.

        Args:
            state: Attitude, suspension, steering and contact angles.
            net_traction: Push along the motion of `find_rolling` in [N], in addition to the force
                that holds the rover against gravity.
            resistance: Resistance to travel that the tractions overcome too, in [N]. A wheel's
                share is in proportion to its speed as all wheels roll.

        Raises:
            ModelError: The equations are singular: the contact angles contradict each other, so
                that the rover could not roll.
        """
        self._take(state, net_traction, resistance)
        A, b = np.zeros((EQUATIONS, FORCES)), np.zeros(EQUATIONS)
        shares, directions = np.zeros((WHEEL_COUNT, 2)), np.zeros(WHEEL_COUNT)
        rows = BalanceRows(A, b, shares, directions, self.weight / WHEEL_COUNT)
        if not write_balance(self.linkages, self.works, rows):
            raise ModelError(
                f"contact angles {np.round(state.contact_angles, 3).tolist()} rad leave the "
                "balance without a solution; they must be such that all wheels can roll at once"
            )
        return rows


def _centre_of_mass(linkage: Any) -> np.ndarray:
    """Return the centre of mass (3,) [m] of the whole rover on flat ground, body frame."""
    total = linkage.body_mass * linkage.body_com
    total = total + linkage.rocker_mass * linkage.rocker_coms.sum(axis=0)
    total = total + linkage.bogie_mass * linkage.bogie_coms.sum(axis=0)
    total = total + linkage.wheel_mass * linkage.wheels.sum(axis=0)
    return total / linkage.mass


@kernel
def complete_forces(A, b, directions, tractions, x):
    """Write x (14,) that keeps all nine equations and the differences between tractions (6,)."""
    last = directions[LAST_WHEEL] * tractions[LAST_WHEEL]
    for row in range(EQUATIONS):
        rest = b[row]
        for wheel in range(WHEEL_COUNT):
            own = tractions[wheel] - directions[wheel] * last
            rest -= A[row, TRACTION + wheel] * own
        if row < TRACTION_EQUATION:
            x[LOAD + row] = rest
    for wheel in range(WHEEL_COUNT):
        common = directions[wheel]
        x[TRACTION + wheel] = tractions[wheel] - common * last + common * rest


@kernel
def _place_wheels(linkages, works):
    """Place the wheels and links of the state in `works`, and write how the wheels roll."""
    linkage, work = linkages[0], works[0]
    measured, placement = work.measured, work.placement
    for wheel in range(WHEEL_COUNT):
        placement.steering[wheel] = measured.steering[wheel]
    place(linkage, work.pose, measured.q, placement)
    _write_rolling(linkage, placement, work.com, work.balance.shares, work.rolling)


@kernel
def write_balance(linkages, works, rows):
    """Write the nine equations at the state in `works`; return False if they are singular."""
    linkage, work = linkages[0], works[0]
    placement, balance, measured = work.placement, work.balance, work.measured
    columns = 1 + FREE_TORQUES
    _place_wheels(linkages, works)
    place_masses(linkage, measured.q, placement)
    for wheel in range(WHEEL_COUNT):
        angle, offset = measured.contact_angles[wheel], measured.contact_offsets[wheel]
        write_point(linkage.radius, work, wheel, (np.sin(angle), np.cos(angle)), offset)
    _weigh_lateral_shares(measured.loads, balance.shares)
    write_equations(linkage, placement, work.contacts, columns, balance)
    _add_push(linkage, work)
    if not solve_equations(columns, balance):
        return False
    _write_rows(balance, rows)
    _add_resistance(measured.resistance / rows.force_unit, rows)
    return True


@kernel
def _weigh_lateral_shares(loads, shares):
    """Multiply the lateral SHARES by loads (6,) over their mean, of at least LEAST_LOAD.

    What wheels can hold is in proportion to their loads. With equal shares those that carry least,
    on a side slope the upper ones, would seem to slip.
    """
    mean = loads.sum() / WHEEL_COUNT
    for wheel in range(WHEEL_COUNT):
        weight = max(loads[wheel] / mean, LEAST_LOAD)
        for term in range(2):
            shares.common[wheel, term] *= weight


@kernel
def _add_push(linkage, work):
    """Add d'Alembert's force of the wanted push to the right-hand sides of the equations.

    It acts on the body at the centre of mass, against the acceleration of the rolling motion:
    straight ahead along body -x, in a curve with a moment about body z.
    """
    push, com, thrust = work.measured.push, work.com, work.rolling.thrust
    load = work.load
    load[0, 0], load[0, 1], load[0, 2] = com[0], com[1], com[2]
    load[1, 0], load[1, 1] = -push * thrust[0], -push * thrust[1]
    load[2, 2] = -push * thrust[2]
    add_body_load(linkage, work.placement, load, work.balance.B)


@kernel
def _write_rows(balance, rows):
    """Write A x = b from the solved balance, whose forces are over the weight; A must be zeros.

    The free tractions of the solution are those beyond the common one, T_k - d_k d_last T_last
    with the directions d.
    """
    A, b, common = rows.A, rows.b, balance.shares.common
    for wheel in range(WHEEL_COUNT):
        rows.directions[wheel] = common[wheel, 2]
        for term in range(2):
            rows.lateral_shares[wheel, term] = common[wheel, term]
    last = common[LAST_WHEEL, 2]
    for row in range(EQUATIONS):
        b[row] = WHEEL_COUNT * balance.B[row, 0]
        for wheel in range(FREE_TORQUES):
            value = balance.B[row, 1 + wheel]
            A[row, TRACTION + wheel] = -value
            A[row, LAST_WHEEL] += value * common[wheel, 2] * last
        if row < TRACTION_EQUATION:
            A[row, LOAD + row] = 1.0
    A[TRACTION_EQUATION, LAST_WHEEL] += last


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


@kernel
def _write_rolling(linkage, placement, com, shares, rolling):
    """Write how placed wheels roll.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT.
        com: (3,) centre of mass of the rover [m], body frame, where a push acts.
        shares: SHARES, written.
        rolling: ROLLING, written.
    """
    write_shares(linkage, placement, shares)
    motion, speeds, length = rolling.motion, rolling.speeds, linkage.length
    turned = has_turned_wheels(placement)
    motion[0], motion[1], motion[2] = 1.0, 0.0, 0.0
    if turned:
        motion[0], motion[1] = shares.rolling[0], shares.rolling[1]
        motion[2] = shares.rolling[2] / length
    mean = 0.0
    for wheel in range(WHEEL_COUNT):
        x, y = place_of(placement, wheel)
        ahead, left = 1.0, 0.0
        if turned:
            # The heading is a quarter turn to the right of the axle.
            ahead, left = shares.axles[wheel, 1], -shares.axles[wheel, 0]
        rolling.arms[wheel] = x * left - y * ahead
        rolling.directions[wheel] = shares.common[wheel, 2]
        speeds[wheel] = ahead * (motion[0] - motion[2] * y) + left * (motion[1] + motion[2] * x)
        mean += rolling.directions[wheel] * speeds[wheel] / WHEEL_COUNT
    if turned:
        for k in range(3):
            motion[k] /= mean
        for wheel in range(WHEEL_COUNT):
            speeds[wheel] /= mean
    # Yaw inertia of a mass at the distance of the middle wheels.
    squared_radius = linkage.wheels[1, 1] * linkage.wheels[1, 1]
    ahead, left = motion[0] - motion[2] * com[1], motion[1] + motion[2] * com[0]
    inertia = ahead * ahead + left * left + squared_radius * motion[2] * motion[2]
    rolling.inertia = inertia
    rolling.thrust[0], rolling.thrust[1] = ahead / inertia, left / inertia
    rolling.thrust[2] = squared_radius * motion[2] / inertia
