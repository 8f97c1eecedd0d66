# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics: the pose in which all six wheels just touch the terrain (paper 3.1).

The six unknowns are q = (z, roll, pitch, right rocker angle, right and left bogie angle). The six
conditions are zero gaps of the wheels. This is the closure of the paper's eqs (1)-(7) in 3-D,
without the assumption of small angles.

Newton's method fails at edges, faces and in narrow hollows. There the gaps are closed wheel by
wheel. A lift of a wheel is a change of the configuration that raises this wheel by one metre and
leaves the heights of the others as they are, to first order. The gap of the wheel is a continuous
function of its lift, negative far down and positive far up. So a root always exists, and
bracketing finds it whatever the shape of the ground. The wheels are closed in turns, because a
lift shifts the other wheels sideways.
"""

import numpy as np

from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.wheel import blend_contact, find_contact
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import cross, difference, dot, solve_in_place
from rover_physics.rover.linkage import pitch_axis, place, rocker_sign
from rover_physics.status import PoseStatus

GAP_TOLERANCE = 3e-4
"""Largest gap in a settled pose [wheel radii], checked by a final search."""
NEWTON_TOLERANCE = 5e-5
"""Largest gap at which Newton's method stops [wheel radii]."""
MAX_NEWTON_STEPS = 6
"""Largest number of Newton steps."""
MAX_STEP = 0.5
"""Largest change of an angle in one of them [rad]."""
QUICK_ATTEMPTS = 5
"""Newton's method runs up to this often; after each time, all ground is looked at."""
PROMISING = 2.0
"""Growth of the largest gap from one attempt to the next that ends the quick attempts."""
RECOVERY_ATTEMPTS = 3
"""Largest number of recoveries from the start: all wheels together, together from a wheel's radius
higher, and one after the other, which may leave one side up and the other down at a face."""
RECOVERIES = 7
"""Times that the gaps are closed wheel by wheel, after the quick attempts have failed."""
FINAL_ATTEMPTS = 3
"""Newton's method runs up to so often after each recovery."""
TURNED_OVER = 1.45
"""Roll or pitch [rad] above which the search stops: the rover is on its end or side."""
TRIALS = 12
"""Largest number of lifts of one wheel between two looks."""
LOOKS = 2
"""Largest number of looks at all ground below one wheel while it is closed."""
CLOSER = 0.1
"""Share of the largest gap to which each gap is closed."""
MAX_TURN = 0.3
"""Largest change of an angle in one trial [rad]."""


@kernel
def settle(model, work):
    """Settle the rover at `work.pose`: write `work.q`, its placement and its contacts.

    The search starts from q = 0, so the result depends on the pose alone. Where Newton's method
    fails, the gaps are closed wheel by wheel: all wheels together, so that no side comes first;
    if that fails, together from higher up; and if that fails, too, one after the other.

    Args:
        model: A record with `ground` GROUND, `linkage` LINKAGE and `samples` WHEEL_SAMPLES.
        work: A record with `pose` (3,): x, y [m] and yaw [rad] of the body origin; `q` (6,),
            `placement` PLACEMENT and `contacts` CONTACTS, written; and work space `J` (6, 6),
            `step` (6, 1).

    Returns:
        A PoseStatus, never NO_EQUILIBRIUM.
    """
    work.q[:] = 0.0
    place(model.linkage, work.pose, work.q, work.placement)
    status, worst = _find_contacts(model, work, SearchScope.COARSE)
    if np.isnan(worst):
        return status
    _lower_to_ground(work)
    if find_step(model.linkage, work, sloped=False):
        share = limit_step(work.step, MAX_STEP)
        for i in range(6):
            work.q[i] -= share * work.step[i, 0]
    place(model.linkage, work.pose, work.q, work.placement)
    status, worst = _find_contacts(model, work, SearchScope.QUICK)
    if status != PoseStatus.SETTLED:
        return status
    worst, tolerance = np.inf, GAP_TOLERANCE * model.samples.radius
    for _ in range(QUICK_ATTEMPTS):
        before = worst
        _newton(model, work)
        status, worst = _find_contacts(model, work, SearchScope.FULL)
        if worst <= tolerance or np.isnan(worst) or worst > PROMISING * before:
            break
    if status == PoseStatus.SETTLED and worst > tolerance:
        for i in range(6):
            work.unsettled[i] = work.q[i]
        for attempt in range(RECOVERY_ATTEMPTS):
            if attempt > 0:
                for i in range(6):
                    work.q[i] = work.unsettled[i]
                work.q[0] += model.samples.radius if attempt == 1 else 0.0
                place(model.linkage, work.pose, work.q, work.placement)
            status, worst = _recover(model, work, attempt != 2)
            stands = worst <= tolerance and not _has_turned_over(work.q)
            if status == PoseStatus.SETTLED and stands:
                break
    if status != PoseStatus.SETTLED:
        return status
    if not worst <= tolerance or _has_turned_over(work.q):
        return PoseStatus.NOT_SETTLED
    for wheel in range(6):
        blend_contact(model, work, wheel)
    return PoseStatus.SETTLED


@kernel
def _recover(model, work, together):
    """Close the gaps wheel by wheel, then by Newton's method, as often as RECOVERIES.

    Args:
        model: As for `settle`.
        work: As for `settle`.
        together: As for `_close_gaps`.

    Returns:
        The worst PoseStatus, and the largest absolute gap [m]; infinite if the rover turns
        over.
    """
    tolerance = GAP_TOLERANCE * model.samples.radius
    status, worst = _find_contacts(model, work, SearchScope.WHOLE)
    for _ in range(RECOVERIES):
        _close_gaps(model, work, worst, together)
        if _has_turned_over(work.q):
            return PoseStatus.SETTLED, np.inf
        status, worst = _find_contacts(model, work, SearchScope.WHOLE)
        for _ in range(FINAL_ATTEMPTS):
            if worst <= tolerance or np.isnan(worst):
                return status, worst
            _newton(model, work)
            status, worst = _find_contacts(model, work, SearchScope.FULL)
    return status, worst


@kernel
def _close_gaps(model, work, worst, together):
    """Close the gaps wheel by wheel, each to a share of the largest one.

    Args:
        model: As for `settle`.
        work: As for `settle`; contacts of all ground below the wheels at `work.q`. `work.q` and
            the placement are written.
        worst: Largest absolute gap [m].
        together: Whether the lifts of all wheels are found from the same configuration and applied
            together; else each starts where the one before has ended.
    """
    start, q = work.start, work.q
    write_gap_rates(model.linkage, work.placement, work.contacts, work.J, sloped=False)
    work.lifts[:, :] = 0.0
    for wheel in range(6):
        work.lifts[wheel, wheel] = 1.0
    if not solve_in_place(work.J, work.lifts, 6, 6):
        return
    for i in range(6):
        start[i] = q[i]
    for wheel in range(6):
        if not together:
            find_contact(model, work, wheel, SearchScope.WHOLE)
        work.step[wheel, 0] = _close(model, work, wheel, CLOSER * worst)
        if together:
            _lift_to(model, work, wheel, 0.0)
        else:
            for i in range(6):
                start[i] = q[i]
    if together:
        for wheel in range(6):
            for i in range(6):
                q[i] += work.step[wheel, 0] * work.lifts[i, wheel]
        place(model.linkage, work.pose, q, work.placement)


@kernel
def _close(model, work, wheel, wanted):
    """Lift a wheel from `work.start` until its gap is at most `wanted`; return the lift [m]."""
    gaps = work.contacts.gap
    lift, largest = 0.0, 0.0
    if not abs(gaps[wheel]) > wanted:
        return lift
    for i in range(1, 6):
        largest = max(largest, abs(work.lifts[i, wheel]))
    longest = MAX_TURN / largest if largest > 0.0 else np.inf
    for _ in range(LOOKS):
        lift = _follow_to_ground(model, work, wheel, (lift, longest, 0.5 * wanted))
        find_contact(model, work, wheel, SearchScope.FULL)
        if not abs(gaps[wheel]) > wanted:
            break
    return lift


@kernel
def _follow_to_ground(model, work, wheel, search):
    """Return the lift [m] at which the followed contacts of a wheel touch, by bracketing.

    `search` is the lift to start from, the longest step, and the gap that is closed enough [m].
    """
    gaps = work.contacts.gap
    lift, longest, wanted = search
    low, high, low_gap, high_gap = -np.inf, np.inf, -np.inf, np.inf
    step, last = -gaps[wheel], 0
    for _ in range(TRIALS):
        gap = gaps[wheel]
        if not abs(gap) > wanted:
            break
        if gap < 0.0:
            if last < 0:
                high_gap *= 0.5  # the Illinois variant of false position
            low, low_gap, last = lift, gap, -1
        else:
            if last > 0:
                low_gap *= 0.5
            high, high_gap, last = lift, gap, 1
        if low > -np.inf and high < np.inf:
            share = low_gap / (low_gap - high_gap)
            lift = low + min(max(share, 0.02), 0.98) * (high - low)
        else:
            step = 2.0 * step if step * gap < 0.0 and 2.0 * abs(step) > abs(gap) else -gap
            step = min(max(step, -longest), longest)
            lift += step
        _lift_to(model, work, wheel, lift)
    return lift


@kernel
def _lift_to(model, work, wheel, lift):
    """Lift a wheel by `lift` [m] from `work.start`, and follow its contacts."""
    for i in range(6):
        work.q[i] = work.start[i] + lift * work.lifts[i, wheel]
    place(model.linkage, work.pose, work.q, work.placement)
    find_contact(model, work, wheel, SearchScope.NEAR)


@kernel
def _find_contacts(model, work, scope):
    """Write all contacts; return the worst PoseStatus and the largest absolute gap [m]."""
    worst = 0.0
    status = PoseStatus.SETTLED
    for wheel in range(6):
        of_wheel = find_contact(model, work, wheel, scope)
        if of_wheel == PoseStatus.OFF_MAP or status == PoseStatus.SETTLED:
            status = of_wheel
        gap = abs(work.contacts.gap[wheel])
        if gap > worst or gap != gap:
            worst = gap
        if worst != worst:
            return status, worst
    return status, worst


@kernel
def _newton(model, work):
    """Apply Newton's method with a halving line search; the last contacts are followed."""
    q, step = work.q, work.step
    worst = 0.0
    for wheel in range(6):
        worst = max(worst, abs(work.contacts.gap[wheel]))
    for _ in range(MAX_NEWTON_STEPS):
        if worst <= NEWTON_TOLERANCE * model.samples.radius or np.isnan(worst):
            return
        if not find_step(model.linkage, work, sloped=True):
            return
        fraction = limit_step(step, MAX_STEP)
        improved = np.inf
        taken = 0.0
        for _ in range(6):
            for i in range(6):
                q[i] -= (fraction - taken) * step[i, 0]
            taken = fraction
            place(model.linkage, work.pose, q, work.placement)
            improved = _find_contacts(model, work, SearchScope.NEAR)[1]
            if improved < (1.0 - 0.1 * fraction) * worst:
                break
            fraction *= 0.5
        if not improved < worst:
            return
        worst = improved


@kernel
def _has_turned_over(q):
    return abs(q[1]) > TURNED_OVER or abs(q[2]) > TURNED_OVER


@kernel
def _lower_to_ground(work):
    """Move the rover by the mean gap, so that only the differences of the gaps turn its parts."""
    gap = work.contacts.gap
    mean = 0.0
    for wheel in range(6):
        mean += gap[wheel] / 6.0
    work.q[0] -= mean
    for wheel in range(6):
        gap[wheel] -= mean


@kernel
def limit_step(step, most):
    """Return the fraction of `step` (6, 1) that changes no angle by more than `most` [rad]."""
    largest = 0.0
    for i in range(1, 6):
        largest = max(largest, abs(step[i, 0]))
    return min(1.0, most / largest) if largest > 0.0 else 1.0


@kernel
def find_step(linkage, work, sloped):
    """Solve J step = gaps; `sloped` is as for `write_gap_rates`. Return False if J is singular."""
    write_gap_rates(linkage, work.placement, work.contacts, work.J, sloped)
    for i in range(6):
        work.step[i, 0] = work.contacts.gap[i]
    return solve_in_place(work.J, work.step, 6, 1)


@kernel
def write_gap_rates(linkage, placement, contacts, J, sloped):
    """Write the derivatives of the gaps by q into J (6, 6) [m/m or m/rad].

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT at q.
        contacts: CONTACTS with points and normals.
        J: (6, 6), row per wheel, column per element of q; written.
        sloped: Whether the ground has the slope at the contact, else it is level.
    """
    about, direction = pitch_axis(placement.R), (0.0, 0.0, 1.0)
    for wheel in range(6):
        normal = contacts.normal[wheel]
        if sloped:
            direction = normal[0], normal[1], 1.0
        write_rates(linkage, placement, wheel, contacts.point[wheel], direction, about, J[wheel])


@kernel
def write_rates(linkage, placement, wheel, point, direction, about, rates):
    """Write the derivatives by q of the place of a point of a wheel along a direction.

    Args:
        linkage: LINKAGE.
        placement: PLACEMENT at q.
        wheel: Index of the wheel.
        point: (3,) the point [m].
        direction: The direction (x, y, z).
        about: The `pitch_axis`.
        rates: (6,) written [m/m or m/rad].
    """
    R, side = placement.R, wheel // 3
    arm, body_y = difference(point, placement.origin), (R[0, 1], R[1, 1], R[2, 1])
    rates[:] = 0.0
    rates[0] = direction[2]
    rates[1] = dot(direction, cross((R[0, 0], R[1, 0], R[2, 0]), arm))
    rates[2] = dot(direction, cross(about, arm))
    arm = difference(point, placement.rocker_pivots[side])
    rates[3] = rocker_sign(side) * dot(direction, cross(body_y, arm))
    if linkage.on_bogie[wheel]:
        arm = difference(point, placement.bogie_pivots[side])
        rates[4 + side] = dot(direction, cross(body_y, arm))
