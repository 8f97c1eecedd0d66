# SPDX-License-Identifier: Apache-2.0
"""Static equilibrium of a settled rover: wheel loads for given torques (paper 3.2 in 3-D).

In the contact frame of a wheel, n points from the ground to the wheel's centre, a is the axis of
the wheel and t = a x n points forward along the ground; on a rim, n and a may lean. The force of
the ground on the wheel is N n + T t + S a. There are nine equations: six for the whole rover about
its body origin, one about each bogie pivot for the bogie and its wheels (eq 15), and one for the
differential, which passes equal moments from both rockers (eq 14 for both sides). The nine
unknowns are six N, two lateral terms and the common part of T; `shares` has the shares of the
wheels in these. With wheels that are not turned, S_i = s0 + s1 x_i (the paper's equal share, and a
linear term for the yaw balance). Differences between the wheels' T are free, because the rover is
over-actuated.
Lengths are scaled by a reference length and forces by the weight, so that the numbers of the
system are of order 1 for any rover.
"""

import numpy as np

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
    ("lean", float, (6,)),  # tangents of the angles by which the normals lean to the left
    ("frames", float, (6, 3, 3)),  # contact frames: rows n, t, a of each wheel, map frame
    ("units", float, (6, 3, UNKNOWNS)),  # terms of unit forces N, T, S of each wheel
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
    balance.lean[:] = 0.0
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
def _write_frames(placement, contacts, lean, frames):
    for wheel in range(6):
        axis, forward, up = placement.axis[wheel], placement.forward[wheel], placement.up[wheel]
        s, c, along = contacts.sine[wheel], contacts.cosine[wheel], lean[wheel]
        upright = 1.0 / np.sqrt(1.0 + along * along)
        for i in range(3):
            radial = c * up[i] - s * forward[i]
            frames[wheel, 0, i] = upright * (radial + along * axis[i])
            frames[wheel, 1, i] = s * up[i] + c * forward[i]
            frames[wheel, 2, i] = upright * (axis[i] - along * radial)


@kernel
def write_equations(linkage, placement, contacts, columns, balance):
    """Write the nine equations: forces, moments about the origin, bogies, differential.

    Rows of balance.A and balance.B: forces along map x, y, z over the weight; moments about map x,
    y, z over weight times reference length; right and left bogie; differential. Arguments are as
    for `balance_forces`; `balance.shares` is as `write_shares` writes it.
    """
    A, B, units = balance.A, balance.B, balance.units
    common, free = balance.shares.common, balance.shares.free
    _write_frames(placement, contacts, balance.lean, balance.frames)
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
    _add_weights(linkage, placement, B)
    if linkage.has_tool_load:
        add_body_load(linkage, placement, linkage.tool, B)


@kernel
def _write_units(linkage, placement, contacts, balance, wheel):
    """Write the terms of the unit forces N, T and S of a wheel in the nine equations."""
    R, length, side = placement.R, linkage.length, wheel // 3
    x, y, z = difference(contacts.point[wheel], placement.origin)
    arm = x / length, y / length, z / length
    for kind in range(3):
        unit, frame = balance.units[wheel, kind], balance.frames[wheel, kind]
        force = frame[0], frame[1], frame[2]
        moment = cross(arm, force)
        about_axis = dot(moment, (R[0, 1], R[1, 1], R[2, 1]))
        unit[0], unit[1], unit[2] = force
        unit[3], unit[4], unit[5] = moment
        unit[6] = unit[7] = 0.0
        if linkage.on_bogie[wheel]:
            about = _moment_about(linkage, placement, placement.bogie_pivots[side], force)
            unit[6 + side] = about_axis - about
        about = _moment_about(linkage, placement, placement.rocker_pivots[side], force)
        unit[8] = rocker_sign(side) * (about_axis - about)


@kernel
def _moment_about(linkage, placement, pivot, force):
    """Return the moment about the origin along the wheel axes of a force (x, y, z) at a pivot."""
    R, origin, length = placement.R, placement.origin, linkage.length
    x, y, z = difference(pivot, origin)
    return dot(cross((x / length, y / length, z / length), force), (R[0, 1], R[1, 1], R[2, 1]))


@kernel
def _add_weights(linkage, placement, B):
    """Add the weights of all parts to the right-hand side."""
    for part in range(5):
        carrier = (part + 1) // 2
        mass = linkage.body_mass
        if carrier == ROCKER:
            mass = linkage.rocker_mass
        elif carrier == BOGIE:
            mass = linkage.bogie_mass
        _add_weight(
            linkage, placement, B, mass, placement.part_coms[part], (part - 1) % 2, carrier
        )
    for wheel in range(6):
        side, carrier = wheel // 3, ROCKER
        if linkage.on_bogie[wheel]:
            carrier = BOGIE
        centre = placement.centres[wheel]
        _add_weight(linkage, placement, B, linkage.wheel_mass, centre, side, carrier)


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


@kernel
def _add_weight(linkage, placement, B, mass, point, side, carrier):
    """Add the weight of one part to the right-hand side.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT.
        B: Right-hand sides; the weight is added to column 0.
        mass: Mass [kg].
        point: (3,) centre of mass [m].
        side: 0 right, 1 left.
        carrier: The link that it is part of, or hangs on: BODY, ROCKER or BOGIE.
    """
    origin, length, weight = placement.origin, linkage.length, mass / linkage.mass
    B[2, 0] += weight
    B[3, 0] += (point[1] - origin[1]) / length * weight
    B[4, 0] -= (point[0] - origin[0]) / length * weight
    if carrier == BODY:
        return
    about = weight * _level_arm(linkage, placement, point, placement.rocker_pivots[side])
    B[8, 0] += about if side == 0 else -about
    if carrier == BOGIE:
        arm = _level_arm(linkage, placement, point, placement.bogie_pivots[side])
        B[6 + side, 0] += weight * arm


@kernel
def _level_arm(linkage, placement, point, pivot):
    """Return the horizontal distance of a point from a pivot axis, over the reference length."""
    R, origin, length = placement.R, placement.origin, linkage.length
    rx, ry = (point[0] - origin[0]) / length, (point[1] - origin[1]) / length
    px, py = (pivot[0] - origin[0]) / length, (pivot[1] - origin[1]) / length
    return (ry - py) * R[0, 1] - (rx - px) * R[1, 1]
