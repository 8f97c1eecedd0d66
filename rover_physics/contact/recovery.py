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
LOOKS = 4
"""Largest number of looks at all ground below one wheel in a turn."""
CLOSER = 0.1
"""A turn closes each gap to this share of the largest one."""
MAX_TURN = 0.3
"""Largest change of an angle in one trial [rad]."""


@kernel
def close_in_turns(model, work, turns, closed, together):
    """Close the gaps wheel by wheel until none exceeds `closed` [m], in at most so many turns.

    Args:
        model: As for `settle`.
        work: As for `settle`; placement and contacts belong to `work.q`, before and after.
        turns: Largest number of turns.
        closed: Gap at which a wheel counts as closed [m].
        together: Whether the lifts of a turn are found from the same configuration and applied
            together; else each starts where the one before has ended.

    Returns:
        The largest absolute gap [m], NaN over unknown ground.
    """
    worst = _find_worst(model, work)
    for _ in range(turns):
        if not worst > closed:
            break
        write_gap_rates(model.linkage, work.placement, work.contacts, GroundSlope.LEVEL, work.J)
        work.lifts[:, :] = 0.0
        for wheel in range(6):
            work.lifts[wheel, wheel] = 1.0
        if not solve_in_place(work.J, work.lifts, 6, 6):
            break
        wanted = max(0.5 * closed, CLOSER * worst)
        _take_turn(model, work, wanted, together)
        worst = _find_worst(model, work)
    return worst


@kernel
def _take_turn(model, work, wanted, together):
    """Lift each wheel to the ground; as for `close_in_turns`."""
    start, q = work.start, work.q
    for i in range(6):
        start[i] = q[i]
    for wheel in range(6):
        work.step[wheel, 0] = _close(model, work, wheel, wanted)
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
def _find_worst(model, work):
    worst = 0.0
    for wheel in range(6):
        find_contact(model, work, wheel, SearchScope.WHOLE)
        gap = abs(work.contacts.gap[wheel])
        if gap > worst or gap != gap:
            worst = gap
        if worst != worst:
            break
    return worst


@kernel
def _close(model, work, wheel, wanted):
    """Lift a wheel from `work.start` until its gap is at most `wanted`; return the lift [m]."""
    gaps = work.contacts.gap
    find_contact(model, work, wheel, SearchScope.WHOLE)
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
