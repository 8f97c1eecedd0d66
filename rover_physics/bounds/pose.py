# SPDX-License-Identifier: Apache-2.0
"""Bounds on the configuration of a rover on ground whose heights are known within bounds.

The height of a wheel at a given place increases with the height of all ground below it, so the
lowest and the highest surface give the exact interval of its height. The change of the
configuration with the heights of the six wheels is the inverse of the derivatives of the gaps. Its
signs give the surface on which each wheel stands when an angle is extreme. The rover is settled
again on these surfaces, because wheels move horizontally when the body rotates.

Source of the idea, for kinematics and without forces: Otsu, Matheron, Ghosh, Toupet and Ono, "Fast
approximate clearance evaluation for rovers with articulated suspension systems", Journal of Field
Robotics 37(5), 2020.
"""

import numpy as np

from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.settling import (
    find_step,
    limit_step,
    write_gap_rates,
    write_rates,
)
from rover_physics.contact.wheel import find_contact
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_algebra import solve_in_place
from rover_physics.numerics.records import record_type
from rover_physics.rover.linkage import pitch_axis, place
from rover_physics.status import BoundStatus, PoseStatus

NOMINAL_GAP = 1e-2
"""Largest gap [wheel radii] of a wheel in the predicted configuration. Next to rocks the search
may miss the nearest point by up to this; the gap then widens the bounds."""
EXTREME_GAP = 3e-4
"""Largest gap [wheel radii] that does not widen the bounds."""
EXTREME_STEPS = 8
"""Largest number of contact searches, one per Newton step, for an extreme configuration."""
MAX_GAP_LEFT = 0.2
"""Largest gap [wheel radii] left in an extreme configuration; above, a wheel is on an edge."""
JUMP = 0.3
"""Largest rise or fall [wheel radii] near a wheel, in addition to that of the slope;
above, the wheel is on an edge."""
LEVEL_CHANGES = (0.8, 0.95, 1.1, 1.3)
"""Rises and falls [wheel radii] at which a second resting place of a wheel is searched. A face too
high to roll over has two: at its foot and on its top."""
MAX_TURN = 0.3
"""Largest change of an angle in one Newton step [rad]."""

SPREAD = record_type(
    ("q", float, (6,)),  # the nominal configuration, as in `settling`
    ("rates", float, (6, 6)),  # derivatives of the gaps by q
    ("response", float, (6, 6)),  # derivatives of q by the wheels' heights
    ("lift", float, (6, 6)),  # the same for level ground under each wheel
    ("low", float, (6,)),  # smallest height of each wheel relative to the nominal one [m]
    ("high", float, (6,)),  # largest height of each wheel relative to the nominal one [m]
    ("q_low", float, (6,)),  # smallest q
    ("q_high", float, (6,)),  # largest q
    ("shift", float, (6,)),  # largest motion of each wheel forward or back [m]
    ("rate", float, (6,)),  # derivatives of a wheel's forward position by q
    ("trial", float, (6,)),  # q of the current step towards an extreme configuration
    ("raised", np.uint8, (6,)),  # 1 for the wheels on the high surface in that configuration
)
"""Bounds on the configuration; heights are those of wheels at their nominal places."""


@kernel
def bound_configuration(uncertain, work):
    """Write the bounds on q between the lowest and the highest surface into `work.spread`.

    Args:
        uncertain: UNCERTAIN, the model on the nominal, the lowest and the highest ground.
        work: BOUNDS_WORK with the pose and the nominal q.

    Returns:
        A BoundStatus.
    """
    spread = work.spread
    outcome = _find_heights(uncertain, work)
    if outcome != BoundStatus.BOUNDED:
        return outcome
    if _may_change_level(uncertain, work):
        return BoundStatus.ON_EDGE
    for i in range(6):
        spread.q_low[i] = spread.q_high[i] = spread.q[i]
    for angle in range(1, 6):
        for side in range(2):
            outcome = _settle_extreme(uncertain, work, angle, 1.0 - 2.0 * side)
            if outcome != BoundStatus.BOUNDED:
                return outcome
    return BoundStatus.BOUNDED


@kernel
def _find_heights(uncertain, work):
    """Write the response and each wheel's interval of heights; keep the nominal contacts."""
    rover, spread, linkage = work.rover, work.spread, uncertain.nominal.linkage
    placement, contacts = rover.placement, rover.contacts
    place(linkage, rover.pose, spread.q, placement)
    spread.low[:] = 0.0
    spread.high[:] = 0.0
    for wheel in range(6):
        for surface in range(2):
            model = uncertain.low if surface == 0 else uncertain.high
            outcome = _find_contact_on(model, rover, wheel)
            if outcome != BoundStatus.BOUNDED:
                return outcome
            if surface == 0:
                spread.low[wheel] = -contacts.gap[wheel]
            else:
                spread.high[wheel] = -contacts.gap[wheel]
        outcome = _find_contact_on(uncertain.nominal, rover, wheel)
        if outcome != BoundStatus.BOUNDED:
            return outcome
        gap = contacts.gap[wheel]
        if abs(gap) > NOMINAL_GAP * linkage.radius:
            return BoundStatus.ON_EDGE
        spread.low[wheel] = min(spread.low[wheel] + gap, 0.0)
        spread.high[wheel] = max(spread.high[wheel] + gap, 0.0)
        in_doubt = spread.high[wheel] > spread.low[wheel]
        if in_doubt and abs(gap) > EXTREME_GAP * linkage.radius:
            spread.low[wheel] -= abs(gap)
            spread.high[wheel] += abs(gap)
    write_gap_rates(linkage, placement, contacts, spread.rates, sloped=False)
    if not _invert(spread.rates, rover.J, spread.lift):
        return BoundStatus.ON_EDGE
    write_gap_rates(linkage, placement, contacts, spread.rates, sloped=True)
    if not _invert(spread.rates, rover.J, spread.response):
        return BoundStatus.ON_EDGE
    return BoundStatus.BOUNDED


@kernel
def _invert(matrix, copy, inverse):
    """Write the inverse of a 6 x 6 matrix; return False if it is singular."""
    for i in range(6):
        for k in range(6):
            copy[i, k] = matrix[i, k]
            inverse[i, k] = 1.0 if i == k else 0.0
    return solve_in_place(copy, inverse, 6, 6)


@kernel
def _may_change_level(uncertain, work):
    """Return whether any wheel of the placed rover may climb or fall to another level."""
    rover, spread, linkage = work.rover, work.spread, uncertain.nominal.linkage
    placement, contacts = rover.placement, rover.contacts
    fx, fy = placement.ahead[0], placement.ahead[1]
    for wheel in range(6):
        slope = -contacts.normal[wheel, 0] * fx - contacts.normal[wheel, 1] * fy
        along, largest = _find_moves(linkage, work, wheel)
        spread.shift[wheel] = largest
        ahead, arm = _find_arm(linkage, wheel, placement)
        for falls in range(2):
            surface = uncertain.low if falls else uncertain.high
            sign = 1.0 - 2.0 * falls
            margin = -spread.low[wheel] if falls else spread.high[wheel]
            for side in range(2):
                shift = largest * (1.0 - 2.0 * side)
                rise = sign * _rise_at(surface, rover, wheel, shift)
                if rise - sign * slope * shift - margin > JUMP * linkage.radius:
                    return True
                for level in LEVEL_CHANGES:
                    needed = level * linkage.radius
                    move = along * sign * needed + shift
                    if ahead * shift <= 0.0:
                        move -= np.copysign(0.5 * needed * needed / arm, ahead)
                    rise = sign * _rise_at(surface, rover, wheel, move)
                    if rise - margin > needed:
                        return True
    return False


@kernel
def _find_arm(linkage, wheel, placement):
    """Return the forward distance of a wheel from its pivot, and the length of the arm [m].

    A wheel that rises or falls by h moves towards its pivot by h^2 / (2 arm). `_find_moves` leaves
    this second-order term out.
    """
    pivots = placement.bogie_pivots if linkage.on_bogie[wheel] else placement.rocker_pivots
    forward, centre, pivot = placement.ahead, placement.centres[wheel], pivots[wheel // 3]
    ahead, square = 0.0, 0.0
    for k in range(3):
        ahead += forward[k] * (centre[k] - pivot[k])
        square += (centre[k] - pivot[k]) ** 2
    return ahead, np.sqrt(square)


@kernel
def _rise_at(model, rover, wheel, move):
    """Return the rise of a wheel [m] when it is moved forward by `move` [m]."""
    placement = rover.placement
    x, y = placement.centres[wheel, 0], placement.centres[wheel, 1]
    placement.centres[wheel, 0] += move * placement.ahead[0]
    placement.centres[wheel, 1] += move * placement.ahead[1]
    find_contact(model, rover, wheel, SearchScope.QUICK)
    placement.centres[wheel, 0], placement.centres[wheel, 1] = x, y
    return -rover.contacts.gap[wheel]


@kernel
def _find_moves(linkage, work, wheel):
    """Return a wheel's forward motion per metre of its own rise, and its largest motion [m].

    The largest motion includes the rise or fall of all wheels on the uncertain ground.
    """
    placement, spread = work.rover.placement, work.spread
    rate, ahead = spread.rate, placement.ahead
    forward, about = (ahead[0], ahead[1], ahead[2]), pitch_axis(placement.R)
    write_rates(linkage, placement, wheel, placement.centres[wheel], forward, about, rate)
    own, largest = 0.0, 0.0
    for other in range(6):
        change = 0.0
        for i in range(6):
            change += rate[i] * spread.response[i, other]
            if other == wheel:
                own += rate[i] * spread.lift[i, other]
        largest += abs(change) * max(spread.high[other], -spread.low[other])
    return own, largest


@kernel
def _find_contact_on(model, rover, wheel):
    """Find the contact of a wheel on one surface; return a BoundStatus."""
    contacts = rover.contacts
    outcome = find_contact(model, rover, wheel, SearchScope.QUICK)
    if outcome != PoseStatus.SETTLED or contacts.gap[wheel] != contacts.gap[wheel]:
        off_map = outcome == PoseStatus.OFF_MAP
        return BoundStatus.OFF_MAP_NEAR if off_map else BoundStatus.UNKNOWN_NEAR
    find_contact(model, rover, wheel, SearchScope.FULL)
    return BoundStatus.BOUNDED


@kernel
def _settle_extreme(uncertain, work, angle, sign):
    """Settle where q[angle] is largest (sign 1) or smallest (-1), and widen the bounds to it."""
    spread, radius = work.spread, uncertain.nominal.linkage.radius
    q = spread.trial
    largest = 0.0
    for i in range(6):
        q[i] = spread.q[i]
    for wheel in range(6):
        raised = sign * spread.response[angle, wheel] > 0.0
        spread.raised[wheel] = 1 if raised else 0
        height = spread.high[wheel] if raised else spread.low[wheel]
        largest = max(largest, abs(height))
        for i in range(6):
            q[i] += spread.response[i, wheel] * height
    if largest == 0.0:
        return BoundStatus.BOUNDED
    outcome, worst = _approach(uncertain, work)
    if outcome != BoundStatus.BOUNDED:
        return outcome
    if worst > MAX_GAP_LEFT * radius:
        return BoundStatus.ON_EDGE
    _include_trial(work, worst > EXTREME_GAP * radius)
    return BoundStatus.BOUNDED


@kernel
def _approach(uncertain, work):
    """Take Newton steps from the trial; return a BoundStatus and the largest gap left [m]."""
    linkage, rover, q = uncertain.nominal.linkage, work.rover, work.spread.trial
    worst = 0.0
    for attempt in range(EXTREME_STEPS):
        outcome, worst = _find_trial_contacts(uncertain, work)
        if outcome != BoundStatus.BOUNDED or worst <= EXTREME_GAP * linkage.radius:
            return outcome, worst
        if attempt == EXTREME_STEPS - 1:
            break
        if not find_step(linkage, rover, sloped=True):
            return BoundStatus.ON_EDGE, worst
        share = limit_step(rover.step, MAX_TURN)
        if attempt > 3:
            share *= 0.5
        for i in range(6):
            q[i] -= share * rover.step[i, 0]
    return BoundStatus.BOUNDED, worst


@kernel
def _find_trial_contacts(uncertain, work):
    """Find the trial's contacts, each on its surface; return BoundStatus and largest gap [m]."""
    rover, spread = work.rover, work.spread
    place(uncertain.nominal.linkage, rover.pose, spread.trial, rover.placement)
    worst = 0.0
    for wheel in range(6):
        model = uncertain.high if spread.raised[wheel] == 1 else uncertain.low
        outcome = _find_contact_on(model, rover, wheel)
        if outcome != BoundStatus.BOUNDED:
            return outcome, np.inf
        worst = max(worst, abs(rover.contacts.gap[wheel]))
    return BoundStatus.BOUNDED, worst


@kernel
def _include_trial(work, unsettled):
    """Widen the bounds on q and on the wheels' heights to the trial and its remaining gaps."""
    spread, gap = work.spread, work.rover.contacts.gap
    q = spread.trial
    for i in range(6):
        left = 0.0
        for wheel in range(6 if unsettled else 0):
            left += abs(spread.response[i, wheel] * gap[wheel])
        spread.q_low[i] = min(spread.q_low[i], q[i] - left)
        spread.q_high[i] = max(spread.q_high[i], q[i] + left)
    for wheel in range(6):
        height = 0.0
        for i in range(6):
            height += spread.rates[wheel, i] * (q[i] - spread.q[i])
        left = abs(gap[wheel]) if unsettled else 0.0
        spread.low[wheel] = min(spread.low[wheel], height - left)
        spread.high[wheel] = max(spread.high[wheel], height + left)
