# SPDX-License-Identifier: Apache-2.0
"""Static equilibrium of a settled rover: wheel loads for given torques (paper 3.2 in 3-D).

In the contact frame of a wheel, n points from the ground to the wheel's centre, a is the axis of
the wheel and t = a x n points forward along the ground. The force of the ground on the wheel is
N n + T t + S a. There are nine equations: six for the whole rover about its body origin, one about
each bogie pivot for the bogie and its wheels (eq 15), and one for the differential, which passes
equal moments from both rockers (eq 14 for both sides). The nine unknowns are six N, two lateral
terms and the common part of T; `shares` has the shares of the wheels in these. With wheels that
are not turned, S_i = s0 + s1 x_i (the paper's equal share, and a linear term for the yaw balance).
Differences between the wheels' T are free, because the rover is over-actuated.
Lengths are scaled by a reference length and forces by the weight, so that the numbers of the
system are of order 1 for any rover.
"""

from rover_physics.forces.shares import FREE_LATERAL_WHEELS, SHARES, write_shares
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import cross, difference, dot, solve_in_place
from rover_physics.numerics.records import record_type
from rover_physics.rover.linkage import rocker_sign

UNKNOWNS = 9
"""Number of equations and unknowns of the equilibrium."""
FREE_TORQUES = 5
"""Degrees of freedom of the torques: extra traction of each wheel except the last."""
FREE_FORCES = FREE_TORQUES + FREE_LATERAL_WHEELS
"""Degrees of freedom of torques and lateral forces together; four are lateral."""
BODY, ROCKER, BOGIE = range(3)
"""Links that carry a part."""

BALANCE = record_type(
    ("normal", float, (6, 1 + FREE_FORCES)),  # wheel loads N
    ("tangential", float, (6, 1 + FREE_FORCES)),  # tractions T
    ("lateral", float, (6, 1 + FREE_FORCES)),  # lateral forces S
    ("A", float, (UNKNOWNS, UNKNOWNS)),  # work space: the equations
    ("B", float, (UNKNOWNS, 1 + FREE_FORCES)),  # work space: right-hand sides, then solutions
    ("frames", float, (6, 3, 3)),  # contact frames: rows n, t, a of each wheel, map frame
    ("units", float, (6, 3, UNKNOWNS)),  # terms of unit forces N, T, S of each wheel
    ("terms", float, (UNKNOWNS,)),  # work space: terms of a weight in the equations
    ("shares", SHARES),  # shares of the wheels in the common forces
)
"""Forces of a settled rover as linear functions of its free forces, over the rover's weight.

Column 0 holds the forces with equal traction on all wheels. Column 1 + k, k < 5, holds their
change per unit of extra traction of wheel k; the common traction balances it. Column 6 + k holds
their change per unit of extra lateral force on wheel `shares.free[k]`; the common lateral terms
balance it.
"""


@kernel
def balance_forces(linkage, placement, contacts, columns, balance):
    """Solve the equilibrium of a settled rover; return False if the equations are singular.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT, with the centres of mass of the parts.
        contacts: CONTACTS.
        columns: Number of columns to solve: 1 for equal traction, 6 with extra tractions, 10 with
            extra lateral forces, too.
        balance: BALANCE, written.
    """
    write_shares(linkage, placement, balance.shares)
    write_equations(linkage, placement, contacts, columns, balance)
    return solve_equations(columns, balance)


@kernel
def solve_equations(columns, balance):
    """Solve the equations of `write_equations`; return False if they are singular."""
    B, common = balance.B, balance.shares.common
    if not solve_in_place(balance.A, B, UNKNOWNS, columns):
        return False
    for k in range(columns):
        for i in range(6):
            balance.normal[i, k] = B[i, k]
            balance.lateral[i, k] = B[6, k] * common[i, 0] + B[7, k] * common[i, 1]
            balance.tangential[i, k] = B[8, k] * common[i, 2]
        if 0 < k <= FREE_TORQUES:
            balance.tangential[k - 1, k] += 1.0
        elif k > FREE_TORQUES:
            balance.lateral[balance.shares.free[k - 1 - FREE_TORQUES], k] += 1.0
    return True


@kernel
def _write_frames(placement, contacts, frames):
    for wheel in range(6):
        axis, forward, up = placement.axis[wheel], placement.forward[wheel], placement.up[wheel]
        s, c = contacts.sine[wheel], contacts.cosine[wheel]
        for i in range(3):
            frames[wheel, 0, i] = c * up[i] - s * forward[i]
            frames[wheel, 1, i] = s * up[i] + c * forward[i]
            frames[wheel, 2, i] = axis[i]


@kernel
def write_equations(linkage, placement, contacts, columns, balance):
    """Write the nine equations: forces, moments about the origin, bogies, differential.

    Rows of balance.A and balance.B: forces along map x, y, z over the weight; moments about map x,
    y, z over weight times reference length; right and left bogie; differential. Arguments are as
    for `balance_forces`; `balance.shares` is as `write_shares` writes it.
    """
    A, B, units = balance.A, balance.B, balance.units
    common, free = balance.shares.common, balance.shares.free
    _write_frames(placement, contacts, balance.frames)
    for wheel in range(6):
        _write_units(linkage, placement, contacts, balance, wheel)
    for row in range(UNKNOWNS):
        share, slope, traction = 0.0, 0.0, 0.0
        for wheel in range(6):
            A[row, wheel] = units[wheel, 0, row]
            share += common[wheel, 0] * units[wheel, 2, row]
            slope += common[wheel, 1] * units[wheel, 2, row]
            traction += common[wheel, 2] * units[wheel, 1, row]
        A[row, 6], A[row, 7], A[row, 8], B[row, 0] = share, slope, traction, 0.0
        for k in range(1, columns):
            wheel, kind = k - 1, 1
            if k > FREE_TORQUES:
                wheel, kind = free[k - 1 - FREE_TORQUES], 2
            B[row, k] = -units[wheel, kind, row]
    _add_weights(linkage, placement, balance)
    if linkage.has_tool_load:
        add_body_load(linkage, placement, linkage.tool, B)


@kernel
def _write_units(linkage, placement, contacts, balance, wheel):
    """Write the terms of the unit forces N, T and S of a wheel in the nine equations."""
    carrier = BOGIE if linkage.on_bogie[wheel] else ROCKER
    for kind in range(3):
        frame = balance.frames[wheel, kind]
        force = frame[0], frame[1], frame[2]
        part = contacts.point[wheel], wheel // 3, carrier
        _write_terms(linkage, placement, part, force, balance.units[wheel, kind])


@kernel
def _write_terms(linkage, placement, part, force, terms):
    """Write the terms (9,) of a force (x, y, z) on a part in the nine equations.

    The part is (point at which the force acts [m], side, link that carries the part).
    """
    R, (point, side, carrier) = placement.R, part
    moment = _moment_about(linkage, placement.origin, point, force)
    terms[0], terms[1], terms[2] = force
    terms[3], terms[4], terms[5] = moment
    terms[6] = terms[7] = terms[8] = 0.0
    axis = R[0, 1], R[1, 1], R[2, 1]
    if carrier == BOGIE:
        pivot = placement.bogie_pivots[side]
        terms[6 + side] = dot(axis, _moment_about(linkage, pivot, point, force))
    if carrier != BODY:
        pivot = placement.rocker_pivots[side]
        about = dot(axis, _moment_about(linkage, pivot, point, force))
        terms[8] = rocker_sign(side) * about


@kernel
def _moment_about(linkage, pivot, point, force):
    """Return the moment (x, y, z) about a pivot of a force (x, y, z) at a point."""
    x, y, z = difference(point, pivot)
    return cross((x / linkage.length, y / linkage.length, z / linkage.length), force)


@kernel
def _add_weights(linkage, placement, balance):
    """Add the weights of all parts to the right-hand side."""
    for part in range(5):
        carrier = (part + 1) // 2
        mass = linkage.body_mass
        if carrier == ROCKER:
            mass = linkage.rocker_mass
        elif carrier == BOGIE:
            mass = linkage.bogie_mass
        centre = placement.part_coms[part], (part - 1) % 2, carrier
        _add_weight(linkage, placement, mass, centre, balance)
    for wheel in range(6):
        carrier = BOGIE if linkage.on_bogie[wheel] else ROCKER
        centre = placement.centres[wheel], wheel // 3, carrier
        _add_weight(linkage, placement, linkage.wheel_mass, centre, balance)


@kernel
def _add_weight(linkage, placement, mass, part, balance):
    """Add the weight of a mass [kg] of a part, as for `_write_terms`, to the right-hand side."""
    _write_terms(linkage, placement, part, (0.0, 0.0, -mass / linkage.mass), balance.terms)
    for row in range(UNKNOWNS):
        balance.B[row, 0] -= balance.terms[row]


@kernel
def add_body_load(linkage, placement, tool, B):
    """Add a force and a moment on the body, such as the tool's, to the right-hand side.

    `tool` is (3, 3): where the force acts [m], force [N] and moment [N m], body frame.
    """
    weight = linkage.mass * linkage.gravity
    for i in range(3):
        force, moment = tool_load(placement.R, tool, i)
        B[i, 0] -= force / weight
        B[3 + i, 0] -= moment / (weight * linkage.length)


@kernel
def tool_load(R, tool, i):
    """Return force [N] and moment about the body origin [N m] of the tool, along map axis i."""
    x, y, z = tool[0, 0], tool[0, 1], tool[0, 2]
    fx, fy, fz = tool[1, 0], tool[1, 1], tool[1, 2]
    mx = tool[2, 0] + y * fz - z * fy
    my = tool[2, 1] + z * fx - x * fz
    mz = tool[2, 2] + x * fy - y * fx
    force = R[i, 0] * fx + R[i, 1] * fy + R[i, 2] * fz
    return force, R[i, 0] * mx + R[i, 1] * my + R[i, 2] * mz
