# SPDX-License-Identifier: Apache-2.0
"""Settling wheel by wheel, where Newton's method fails: at edges, faces and in narrow hollows.

A lift of a wheel is a change of the configuration that raises this wheel by one metre and leaves
the heights of the others as they are, to first order. The gap of the wheel is a continuous
function of its lift, negative far down and positive far up. So a root always exists, and
bracketing finds it whatever the shape of the ground. The wheels are closed in turns, because a
lift shifts the other wheels sideways.
"""

import numpy as np

from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.gap_rates import GroundSlope, write_gap_rates
from rover_physics.contact.wheel import find_contact
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_solve import solve_in_place
from rover_physics.rover.linkage import place

TRIALS = 12
"""Largest number of lifts of one wheel between two looks."""
LOOKS = 2
"""Largest number of looks at all ground below one wheel while it is closed."""
CLOSER = 0.1
"""Share of the largest gap to which each gap is closed."""
MAX_TURN = 0.3
"""Largest change of an angle in one trial [rad]."""


@kernel
def close_gaps(model, work, worst, together):
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
    write_gap_rates(model.linkage, work.placement, work.contacts, GroundSlope.LEVEL, work.J)
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
