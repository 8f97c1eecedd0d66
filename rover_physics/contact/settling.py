"""Inverse kinematics: the pose in which all six wheels just touch the terrain (paper 3.1).

Six unknowns, q = (z, roll, pitch, right rocker angle, right and left bogie angle), and six
conditions, the gaps of the wheels. This is the closure of the paper's eqs (1)-(7) in 3-D without
small angles.
"""

import numpy as np

from rover_physics.contact.contact_record import (
    AGAIN,
    COARSE,
    EXACT,
    FULL,
    IN_CONTACT,
    NEAR,
    QUICK,
)
from rover_physics.contact.wheel import blend_contact, find_contact
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_solve import solve_in_place
from rover_physics.rover.linkage import place, rocker_sign

SETTLED, OFF_MAP, UNKNOWN_GROUND, NOT_SETTLED = 0, 1, 2, 3
GAP_TOLERANCE = 3e-5
"""Largest gap left in a settled pose [m], found by a search of its own."""
NEWTON_TOLERANCE = 5e-6
"""Largest gap at which Newton's method stops [m]."""
NEWTON_STEPS = 20
QUICK_ATTEMPTS = 5
NOTES_HOLD = 1e-2
"""Gaps, in wheel radii, below which a step is too small to bring other circles near."""
RECOVERIES = 6
LEVEL, SLOPED = np.arange(2)
RELAXATION_STEPS = 120
RELAXED = 0.003
"""Largest gap, in wheel radii, at which relaxation hands over to Newton's method."""
RELAXED_FURTHER = 0.25
"""The same after each attempt that failed: wedged between tread and face, gaps are small."""
RELAXATION = 0.3
TURNED_OVER = 1.45
"""Roll or pitch [rad] beyond which the search is given up: the rover is on its end or side."""


@kernel
def settle(ground, linkage, samples, x, y, yaw, q, placement, contacts, J, step):
    """Settle the rover with its body origin at (x, y) [m] heading `yaw` [rad]; q (6,) is written.

    Starts from the suspension at rest, so the answer depends on nothing but the pose. J (6, 6) and
    step (6, 1) are work space. Returns SETTLED, OFF_MAP, UNKNOWN_GROUND or NOT_SETTLED.
    """
    q[:] = 0.0
    place(linkage, x, y, yaw, q, placement)
    status, worst = _find_contacts(ground, samples, placement, COARSE, contacts)
    if np.isnan(worst):
        return status
    _descend(linkage, placement, contacts, q, 1.0, J, step)
    return settle_from(ground, linkage, samples, x, y, yaw, q, placement, contacts, J, step)


@kernel
def settle_from(ground, linkage, samples, x, y, yaw, q, placement, contacts, J, step):
    """Settle the rover as `settle` does, but from the q that is given, such as a neighbour's.

    Faster than from rest, but over edges it depends on q which of several poses is found.
    """
    place(linkage, x, y, yaw, q, placement)
    status, worst = _find_contacts(ground, samples, placement, QUICK, contacts)
    if status != IN_CONTACT:
        return status
    worst = np.inf
    for _ in range(QUICK_ATTEMPTS):
        scope = AGAIN if worst <= NOTES_HOLD * linkage.radius else FULL
        _newton(ground, linkage, samples, x, y, yaw, q, placement, NEAR, contacts, J, step)
        status, worst = _find_contacts(ground, samples, placement, scope, contacts)
        if worst <= GAP_TOLERANCE or np.isnan(worst):
            break
    for attempt in range(RECOVERIES):
        if worst <= GAP_TOLERANCE or np.isnan(worst) or status != IN_CONTACT:
            break
        _find_contacts(ground, samples, placement, EXACT, contacts)
        if attempt > 0:
            relaxed = RELAXED * linkage.radius * RELAXED_FURTHER ** (attempt - 1)
            scope = EXACT if attempt == RECOVERIES - 1 else QUICK
            _relax(
                relaxed, scope, ground, linkage, samples, x, y, yaw,
                q, placement, contacts, J, step,
            )  # fmt: skip
        _newton(ground, linkage, samples, x, y, yaw, q, placement, EXACT, contacts, J, step)
        status, worst = _find_contacts(ground, samples, placement, EXACT, contacts)
        if _has_turned_over(q):
            return NOT_SETTLED
    if status != IN_CONTACT:
        return status
    if not worst <= GAP_TOLERANCE or _has_turned_over(q):
        return NOT_SETTLED
    for wheel in range(6):
        blend_contact(samples, placement, wheel, contacts)
    return SETTLED


@kernel
def _find_contacts(ground, samples, placement, scope, contacts):
    """Return the status of the worst wheel and the largest absolute gap [m]."""
    worst = 0.0
    status = IN_CONTACT
    for wheel in range(6):
        of_wheel = find_contact(ground, samples, placement, wheel, scope, contacts)
        if of_wheel == OFF_MAP or status == IN_CONTACT:
            status = of_wheel
        gap = abs(contacts.gap[wheel])
        if gap > worst or gap != gap:
            worst = gap
        if worst != worst:
            return status, worst
    return status, worst


@kernel
def _newton(ground, linkage, samples, x, y, yaw, q, placement, scope, contacts, J, step):
    """Newton's method on the gaps with a halving line search; returns the largest left."""
    worst = 0.0
    for wheel in range(6):
        worst = max(worst, abs(contacts.gap[wheel]))
    for _ in range(NEWTON_STEPS):
        if worst <= NEWTON_TOLERANCE or np.isnan(worst):
            return worst
        if not _find_step(linkage, placement, contacts, SLOPED, J, step):
            return worst
        fraction = _limit_step(step)
        improved = np.inf
        taken = 0.0
        for _ in range(6):
            for i in range(6):
                q[i] -= (fraction - taken) * step[i, 0]
            taken = fraction
            place(linkage, x, y, yaw, q, placement)
            status, improved = _find_contacts(ground, samples, placement, scope, contacts)
            if improved < (1.0 - 0.1 * fraction) * worst:
                break
            fraction *= 0.5
        if not improved < worst:
            return improved
        worst = improved
    return worst


@kernel
def _relax(relaxed, scope, ground, linkage, samples, x, y, yaw, q, placement, contacts, J, step):
    """Let the wheels fall or rise by part of their gaps until none is above `relaxed` [m].

    Slow, but it does not cycle: a wheel that has no equilibrium at the foot of a step goes up to
    its top, as it would on the ground.
    """
    for _ in range(RELAXATION_STEPS):
        _descend(linkage, placement, contacts, q, RELAXATION, J, step)
        place(linkage, x, y, yaw, q, placement)
        status, worst = _find_contacts(ground, samples, placement, scope, contacts)
        if not worst > relaxed or _has_turned_over(q):
            break
    _find_contacts(ground, samples, placement, EXACT, contacts)


@kernel
def _has_turned_over(q):
    return abs(q[1]) > TURNED_OVER or abs(q[2]) > TURNED_OVER


@kernel
def _descend(linkage, placement, contacts, q, fraction, J, step):
    """Take a fraction of the step that closes the gaps if the ground is level under each wheel."""
    if _find_step(linkage, placement, contacts, LEVEL, J, step):
        fraction *= _limit_step(step)
        for i in range(6):
            q[i] -= fraction * step[i, 0]


@kernel
def _limit_step(step):
    """Return the fraction of `step` that turns nothing by more than 0.5 rad."""
    largest = 0.0
    for i in range(1, 6):
        largest = max(largest, abs(step[i, 0]))
    return min(1.0, 0.5 / largest) if largest > 0.0 else 1.0


@kernel
def _find_step(linkage, placement, contacts, ground_is, J, step):
    """Solve J step = gaps; the ground counts as SLOPED as it is, or as LEVEL under each wheel."""
    write_gap_rates(linkage, placement, contacts, ground_is, J)
    for i in range(6):
        step[i, 0] = contacts.gap[i]
    return solve_in_place(J, step, 6, 1)


@kernel
def write_gap_rates(linkage, placement, contacts, ground_is, J):
    """Write the derivatives of the gaps by q into J (6, 6); the ground is as in `_find_step`."""
    J[:, :] = 0.0
    R, origin = placement.R, placement.origin
    rocker_pivots, bogie_pivots = placement.rocker_pivots, placement.bogie_pivots
    point, normal = contacts.point, contacts.normal
    length = np.sqrt(R[0, 0] * R[0, 0] + R[1, 0] * R[1, 0])
    cos_yaw, sin_yaw = R[0, 0] / length, R[1, 0] / length
    nx, ny = 0.0, 0.0
    for i in range(6):
        side = i // 3
        if ground_is == SLOPED:
            nx, ny = normal[i, 0], normal[i, 1]
        dx, dy, dz = point[i, 0] - origin[0], point[i, 1] - origin[1], point[i, 2] - origin[2]
        J[i, 0] = 1.0
        J[i, 1] = _gap_rate(R[0, 0], R[1, 0], R[2, 0], dx, dy, dz, nx, ny)
        J[i, 2] = _gap_rate(-sin_yaw, cos_yaw, 0.0, dx, dy, dz, nx, ny)
        dx = point[i, 0] - rocker_pivots[side, 0]
        dy = point[i, 1] - rocker_pivots[side, 1]
        dz = point[i, 2] - rocker_pivots[side, 2]
        rate = _gap_rate(R[0, 1], R[1, 1], R[2, 1], dx, dy, dz, nx, ny)
        J[i, 3] = rocker_sign(side) * rate
        if linkage.on_bogie[i]:
            dx = point[i, 0] - bogie_pivots[side, 0]
            dy = point[i, 1] - bogie_pivots[side, 1]
            dz = point[i, 2] - bogie_pivots[side, 2]
            J[i, 4 + side] = _gap_rate(R[0, 1], R[1, 1], R[2, 1], dx, dy, dz, nx, ny)


@kernel
def _gap_rate(ax, ay, az, dx, dy, dz, nx, ny):
    """Return how fast the gap at (dx, dy, dz) grows in a turn about the axis (ax, ay, az)."""
    return nx * (ay * dz - az * dy) + ny * (az * dx - ax * dz) + (ax * dy - ay * dx)
