# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics: the pose in which all six wheels just touch the terrain (paper 3.1).

The six unknowns are q = (z, roll, pitch, right rocker angle, right and left bogie angle). The six
conditions are zero gaps of the wheels. This is the closure of the paper's eqs (1)-(7) in 3-D,
without the assumption of small angles.
"""

import numpy as np

from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.gap_rates import GroundSlope, write_gap_rates
from rover_physics.contact.recovery import close_gaps
from rover_physics.contact.wheel import blend_contact, find_contact
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.linear_solve import solve_in_place
from rover_physics.rover.linkage import place
from rover_physics.status import ContactStatus, PoseStatus

GAP_TOLERANCE = 3e-5
"""Largest gap in a settled pose [m], checked by a final search."""
NEWTON_TOLERANCE = 5e-6
"""Largest gap at which Newton's method stops [m]."""
MAX_NEWTON_STEPS = 6
"""Largest number of Newton steps."""
QUICK_ATTEMPTS = 5
"""Newton's method runs up to this often; after each time, all ground is looked at."""
PROMISING = 2.0
"""Growth of the largest gap from one attempt to the next that ends the quick attempts."""
RECOVERIES = 7
"""Times that the gaps are closed wheel by wheel, after the quick attempts have failed: first all
wheels together, so that no side comes first, then, if that fails, one after the other."""
FINAL_ATTEMPTS = 3
"""Newton's method runs up to so often after each recovery."""
TURNED_OVER = 1.45
"""Roll or pitch [rad] above which the search stops: the rover is on its end or side."""


@kernel
def settle(model, work):
    """Settle the rover at `work.pose`: write `work.q`, its placement and its contacts.

    The search starts from q = 0, so the result depends on the pose alone.

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
        return _refuse(status)
    _lower_to_ground(work)
    _descend(model, work, 1.0)
    return settle_from(model, work)


@kernel
def settle_from(model, work):
    """Settle the rover as `settle` does, but start from `work.q`, such as that of a neighbour.

    This is faster. Over edges with several solutions, the start decides which one is found.
    """
    place(model.linkage, work.pose, work.q, work.placement)
    status, worst = _find_contacts(model, work, SearchScope.QUICK)
    if status != ContactStatus.IN_CONTACT:
        return _refuse(status)
    worst = np.inf
    for _ in range(QUICK_ATTEMPTS):
        before = worst
        _newton(model, work, SearchScope.NEAR)
        status, worst = _find_contacts(model, work, SearchScope.FULL)
        if worst <= GAP_TOLERANCE or np.isnan(worst) or worst > PROMISING * before:
            break
    if status == ContactStatus.IN_CONTACT and worst > GAP_TOLERANCE:
        for i in range(6):
            work.unsettled[i] = work.q[i]
        status, worst = _recover(model, work, True)
        if status == ContactStatus.IN_CONTACT and not worst <= GAP_TOLERANCE:
            for i in range(6):
                work.q[i] = work.unsettled[i]
            place(model.linkage, work.pose, work.q, work.placement)
            status, worst = _recover(model, work, False)
    if status != ContactStatus.IN_CONTACT:
        return _refuse(status)
    if not worst <= GAP_TOLERANCE or _has_turned_over(work.q):
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
        together: As for `close_gaps`.

    Returns:
        The worst ContactStatus, and the largest absolute gap [m]; infinite if the rover turns
        over.
    """
    status, worst = _find_contacts(model, work, SearchScope.WHOLE)
    for _ in range(RECOVERIES):
        close_gaps(model, work, worst, together)
        if _has_turned_over(work.q):
            return ContactStatus.IN_CONTACT, np.inf
        status, worst = _find_contacts(model, work, SearchScope.WHOLE)
        for _ in range(FINAL_ATTEMPTS):
            if worst <= GAP_TOLERANCE or np.isnan(worst):
                return status, worst
            _newton(model, work, SearchScope.NEAR)
            status, worst = _find_contacts(model, work, SearchScope.FULL)
    return status, worst


@kernel
def _refuse(status):
    """Return the PoseStatus of a pose with a wheel off the map or over unknown ground."""
    if status == ContactStatus.OFF_MAP:
        return PoseStatus.OFF_MAP
    return PoseStatus.UNKNOWN_GROUND


@kernel
def _find_contacts(model, work, scope):
    """Write all contacts; return the worst ContactStatus and the largest absolute gap [m]."""
    worst = 0.0
    status = ContactStatus.IN_CONTACT
    for wheel in range(6):
        of_wheel = find_contact(model, work, wheel, scope)
        if of_wheel == ContactStatus.OFF_MAP or status == ContactStatus.IN_CONTACT:
            status = of_wheel
        gap = abs(work.contacts.gap[wheel])
        if gap > worst or gap != gap:
            worst = gap
        if worst != worst:
            return status, worst
    return status, worst


@kernel
def _newton(model, work, scope):
    """Apply Newton's method with a halving line search; return the largest remaining gap [m]."""
    q, step = work.q, work.step
    worst = 0.0
    for wheel in range(6):
        worst = max(worst, abs(work.contacts.gap[wheel]))
    for _ in range(MAX_NEWTON_STEPS):
        if worst <= NEWTON_TOLERANCE or np.isnan(worst):
            return worst
        if not _find_step(model.linkage, work, GroundSlope.SLOPED):
            return worst
        fraction = _limit_step(step)
        improved = np.inf
        taken = 0.0
        for _ in range(6):
            for i in range(6):
                q[i] -= (fraction - taken) * step[i, 0]
            taken = fraction
            place(model.linkage, work.pose, q, work.placement)
            status, improved = _find_contacts(model, work, scope)
            if improved < (1.0 - 0.1 * fraction) * worst:
                break
            fraction *= 0.5
        if not improved < worst:
            return improved
        worst = improved
    return worst


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
def _descend(model, work, fraction):
    """Take a fraction of the step that would close the gaps on level ground under each wheel."""
    if _find_step(model.linkage, work, GroundSlope.LEVEL):
        fraction *= _limit_step(work.step)
        for i in range(6):
            work.q[i] -= fraction * work.step[i, 0]


@kernel
def _limit_step(step):
    """Return the fraction of `step` that changes no angle by more than 0.5 rad."""
    largest = 0.0
    for i in range(1, 6):
        largest = max(largest, abs(step[i, 0]))
    return min(1.0, 0.5 / largest) if largest > 0.0 else 1.0


@kernel
def _find_step(linkage, work, ground_is):
    """Solve J step = gaps; `ground_is` is a GroundSlope. Return False if J is singular."""
    write_gap_rates(linkage, work.placement, work.contacts, ground_is, work.J)
    for i in range(6):
        work.step[i, 0] = work.contacts.gap[i]
    return solve_in_place(work.J, work.step, 6, 1)
