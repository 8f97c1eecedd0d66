# SPDX-License-Identifier: Apache-2.0
"""Shares of the wheels in the common traction and in the two common lateral terms.

The wheels roll along some planar motion of the body, (vx, vy, yaw rate): straight ahead if they
are not turned, else about the point where their axles meet. In this motion no wheel moves along
its axle; if the axles do not meet, it is the motion with the least such movement. The common
traction pushes along it: the share of a wheel is 1, or -1 where the wheel rolls backwards.

Every other planar creep of the body moves the wheels along their axles. The lateral forces are in
proportion to this movement, S_i = c . g_i, where c is the creep and g_i = (a_x, a_y, x a_y - y
a_x) has the axle (a_x, a_y) and the place (x, y) of the wheel. The rolling motion itself adds
nothing, so two creeps at right angles to it suffice, and their coefficients are the two unknowns.
If no wheel is turned, they are the sideways motion and the rotation, with S_i = s0 + s1 x_i: the
paper's equal share and a linear term for the yaw balance. For a turn on the spot they are the
motions forward and sideways. Rolling motion and creeps are independent, so forces and yaw moment
can be balanced for any steering angles.
"""

import numpy as np

from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import cross, dot
from rover_physics.numerics.records import record_type

REFINEMENTS = 3
"""Steps of the power iteration for the rolling motion; one is exact if the axles meet."""
WELL_APART = 0.5
"""Determinant of two wheels' lateral shares, over the largest of all pairs, that is enough."""
FREE_LATERAL_WHEELS = 4
"""Number of wheels with a free extra lateral force."""

SHARES = record_type(
    ("common", float, (6, 3)),  # shares in the two lateral terms, and in the traction
    ("free", np.int64, (FREE_LATERAL_WHEELS,)),  # wheels with a free extra lateral force
    ("axles", float, (6, 3)),  # work space: g_i
    ("rolling", float, (3,)),  # work space: the rolling motion
    ("creeps", float, (2, 3)),  # work space: the creeps
    ("G", float, (3, 3)),  # work space: sum of g_i g_i^T
    ("adjugate", float, (3, 3)),  # work space: its adjugate
)
"""Shares of the wheels. The lateral shares of the two wheels that are not in `free` are
independent, so that the common terms can balance any extra forces on the others."""


@kernel
def has_turned_wheels(placement):
    """Return whether any wheel of a PLACEMENT is turned."""
    turned = False
    for wheel in range(6):
        turned |= placement.steering[wheel] != 0.0
    return turned


@kernel
def write_shares(linkage, placement, shares):
    """Write the SHARES of a placed rover.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT.
        shares: SHARES, written.
    """
    common, free = shares.common, shares.free
    free[0], free[1], free[2], free[3] = 1, 3, 4, 5
    if not has_turned_wheels(placement):
        for wheel in range(6):
            common[wheel, 0], common[wheel, 2] = 1.0, 1.0
            common[wheel, 1] = place_of(placement, wheel)[0] / linkage.length
        return
    _write_axles(linkage, placement, shares)
    _find_rolling_motion(shares)
    _write_creeps(shares)
    axles, rolling = shares.axles, shares.rolling
    for wheel in range(6):
        for term in range(2):
            common[wheel, term] = 0.0
            for k in range(3):
                common[wheel, term] += shares.creeps[term, k] * axles[wheel, k]
        x, y = place_of(placement, wheel)
        x, y = x / linkage.length, y / linkage.length
        # The wheel's heading is (a_y, -a_x).
        push = (rolling[0] - rolling[2] * y) * axles[wheel, 1]
        push -= (rolling[1] + rolling[2] * x) * axles[wheel, 0]
        common[wheel, 2] = 1.0 if push >= 0.0 else -1.0
    _choose_free_wheels(shares)


@kernel
def place_of(placement, wheel):
    """Return the position of a wheel along body x and y [m]."""
    R, origin, centres = placement.R, placement.origin, placement.centres
    x = y = 0.0
    for i in range(3):
        x += R[i, 0] * (centres[wheel, i] - origin[i])
        y += R[i, 1] * (centres[wheel, i] - origin[i])
    return x, y


@kernel
def _write_axles(linkage, placement, shares):
    R, axis = placement.R, placement.axis
    for wheel in range(6):
        ahead, left = 0.0, 0.0
        for i in range(3):
            ahead += R[i, 0] * axis[wheel, i]
            left += R[i, 1] * axis[wheel, i]
        x, y = place_of(placement, wheel)
        x, y = x / linkage.length, y / linkage.length
        shares.axles[wheel, 0], shares.axles[wheel, 1] = ahead, left
        shares.axles[wheel, 2] = x * left - y * ahead


@kernel
def _find_rolling_motion(shares):
    """Write the unit motion that moves the wheels least along their axles.

    It is the eigenvector of G = sum g_i g_i^T with the least eigenvalue, and that of its adjugate
    with the largest one.
    """
    G, adjugate, m = shares.G, shares.adjugate, shares.rolling
    G[:, :] = 0.0
    for wheel in range(6):
        for i in range(3):
            for k in range(3):
                G[i, k] += shares.axles[wheel, i] * shares.axles[wheel, k]
    best = 0
    for i in range(3):
        adjugate[i, 0], adjugate[i, 1], adjugate[i, 2] = cross(G[(i + 1) % 3], G[(i + 2) % 3])
    for i in range(1, 3):
        if adjugate[i, i] > adjugate[best, best]:
            best = i
    for i in range(3):
        m[i] = adjugate[i, best]
    _normalise(m)
    for _ in range(REFINEMENTS):
        last = m[0], m[1], m[2]
        for i in range(3):
            m[i] = dot(adjugate[i], last)
        _normalise(m)


@kernel
def _normalise(vector):
    length = np.sqrt(dot(vector, vector))
    for i in range(3):
        vector[i] /= length


@kernel
def _write_creeps(shares):
    """Write two unit motions at right angles to the rolling motion and to each other."""
    m, first, second = shares.rolling, shares.creeps[0], shares.creeps[1]
    least = 0
    for i in range(1, 3):
        if abs(m[i]) < abs(m[least]):
            least = i
    for i in range(3):
        first[i] = (1.0 if i == least else 0.0) - m[least] * m[i]
    _normalise(first)
    second[0], second[1], second[2] = cross(m, first)


@kernel
def _choose_free_wheels(shares):
    """Choose the two wheels that are not free: rear and front right if these are well apart."""
    rear, front, one, other = 0, 2, 0, 2
    for i in range(5):
        for k in range(i + 1, 6):
            if _apart(shares, i, k) > _apart(shares, one, other):
                one, other = i, k
    if _apart(shares, rear, front) < WELL_APART * _apart(shares, one, other):
        rear, front = one, other
    row = 0
    for wheel in range(6):
        if wheel != rear and wheel != front:
            shares.free[row] = wheel
            row += 1


@kernel
def _apart(shares, i, k):
    """Return the size of the determinant of two wheels' lateral shares."""
    common = shares.common
    return abs(common[i, 0] * common[k, 1] - common[i, 1] * common[k, 0])
