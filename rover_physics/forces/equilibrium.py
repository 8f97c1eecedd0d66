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

BALANCE = record_type(
    ("normal", float, (6, 1 + FREE_FORCES)),  # wheel loads N
    ("tangential", float, (6, 1 + FREE_FORCES)),  # tractions T
    ("lateral", float, (6, 1 + FREE_FORCES)),  # lateral forces S
    ("A", float, (UNKNOWNS, UNKNOWNS)),  # work space: the equations
    ("B", float, (UNKNOWNS, 1 + FREE_FORCES)),  # work space: right-hand sides, then solutions
    ("frames", float, (6, 3, 3)),  # contact frames: rows n, t, a of each wheel, map frame
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
    A, B, frames = balance.A, balance.B, balance.frames
    _write_frames(placement, contacts, frames)
    common, free = balance.shares.common, balance.shares.free
    A[:, :] = 0.0
    B[:, :] = 0.0
    R, length = placement.R, linkage.length
    for wheel in range(6):
        side, (x, y, z) = wheel // 3, difference(contacts.point[wheel], placement.origin)
        arm = x / length, y / length, z / length
        for kind in range(3):
            force = frames[wheel, kind, 0], frames[wheel, kind, 1], frames[wheel, kind, 2]
            moment = cross(arm, force)
            about_axis = dot(moment, (R[0, 1], R[1, 1], R[2, 1]))
            about = _moment_about(linkage, placement, placement.rocker_pivots[side], force)
            about_rocker, about_bogie = about_axis - about, 0.0
            if linkage.on_bogie[wheel]:
                about = _moment_about(linkage, placement, placement.bogie_pivots[side], force)
                about_bogie = about_axis - about
            wrench = *force, *moment, about_bogie, rocker_sign(side) * about_rocker
            column, share = wheel, 1.0  # variables: literals would be types of their own
            if kind == 1:
                column, share = 8, common[wheel, 2]
            elif kind == 2:
                column, share = 6, common[wheel, 0]
            _add_column(A, column, share, wrench, side)
            if kind == 2:
                _add_column(A, column + 1, common[wheel, 1], wrench, side)
            own = 0
            if kind == 1 and wheel < FREE_TORQUES:
                own = 1 + wheel
            elif kind == 2:
                for k in range(FREE_LATERAL_WHEELS):
                    if free[k] == wheel:
                        own = 1 + FREE_TORQUES + k
            if 0 < own < columns:
                _add_column(B, own, -1.0, wrench, side)
    _add_weights(linkage, placement, B)
    if linkage.has_tool_load:
        _add_tool_load(linkage, placement, B)


@kernel
def _add_column(matrix, column, share, wrench, side):
    """Add `share` of a wheel's unit force to a column of the nine equations.

    `wrench` holds the force (3), the moment about the origin (3), the moment about the bogie pivot
    of its side, and its term in the equation of the differential.
    """
    fx, fy, fz, mx, my, mz, about_bogie, about_differential = wrench
    matrix[0, column] += share * fx
    matrix[1, column] += share * fy
    matrix[2, column] += share * fz
    matrix[3, column] += share * mx
    matrix[4, column] += share * my
    matrix[5, column] += share * mz
    matrix[6 + side, column] += share * about_bogie
    matrix[8, column] += share * about_differential


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
        mass = linkage.body_mass
        if part > 2:
            mass = linkage.bogie_mass
        elif part > 0:
            mass = linkage.rocker_mass
        hangs = (part - 1) % 2, part > 0, part > 2
        _add_weight(linkage, placement, B, (mass, placement.part_coms[part]), hangs)
    for wheel in range(6):
        hangs = wheel // 3, wheel >= 0, linkage.on_bogie[wheel] > 0
        load = linkage.wheel_mass, placement.centres[wheel]
        _add_weight(linkage, placement, B, load, hangs)


@kernel
def _add_tool_load(linkage, placement, B):
    """Add the tool's force and moment to the right-hand side; they act on the body."""
    weight = linkage.mass * linkage.gravity
    for i in range(3):
        force, moment = tool_load(placement.R, linkage.tool, i)
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
def _add_weight(linkage, placement, B, load, hangs):
    """Add the weight of one part to the right-hand side.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT.
        B: Right-hand sides; the weight is added to column 0.
        load: (mass [kg], centre of mass (3,) [m]).
        hangs: (side, whether the part hangs on the rocker, whether on the bogie).
    """
    R, origin, length = placement.R, placement.origin, linkage.length
    mass, point = load
    side, on_rocker, on_bogie = hangs
    weight = mass / linkage.mass
    rx = (point[0] - origin[0]) / length
    ry = (point[1] - origin[1]) / length
    B[2, 0] += weight
    B[3, 0] += ry * weight
    B[4, 0] -= rx * weight
    if not on_rocker:
        return
    px = (placement.rocker_pivots[side, 0] - origin[0]) / length
    py = (placement.rocker_pivots[side, 1] - origin[1]) / length
    about = weight * ((ry - py) * R[0, 1] - (rx - px) * R[1, 1])
    B[8, 0] += about if side == 0 else -about
    if on_bogie:
        px = (placement.bogie_pivots[side, 0] - origin[0]) / length
        py = (placement.bogie_pivots[side, 1] - origin[1]) / length
        B[6 + side, 0] += weight * ((ry - py) * R[0, 1] - (rx - px) * R[1, 1])
