"""Scan of a wheel's rim: the vertical gaps of its samples to the ground, and the nearest ones."""

import numpy as np

from rover_physics.contact.circle_search import refine_from
from rover_physics.contact.contact_record import CIRCLE_REACH, FAR_ROW, SearchScope
from rover_physics.numerics.kernels import kernel
from rover_physics.status import ContactStatus
from rover_physics.terrain.ground import (
    elevation_of,
    find_block_max,
    height_at_cell,
    height_inside,
    is_cell_on_map,
)

EXACT_REACH = 0.5
"""Gap above the smallest one [wheel radii] up to which an EXACT search refines a sample. It is
large because next to a face the gap changes much between two samples."""


@kernel
def scan_rim(model, work, wheel, scope):
    """Sample the rim of a wheel and write its nearest samples into `work.contacts`.

    Args:
        model: A record with `ground` GROUND and `samples` WHEEL_SAMPLES.
        work: A record with `placement` PLACEMENT and `contacts` CONTACTS.
        wheel: Index of the wheel.
        scope: A SearchScope.

    Returns:
        The worst ContactStatus of the samples.
    """
    samples, contacts = model.samples, work.contacts
    start = samples.rows // 2
    if scope == SearchScope.FULL:
        start = contacts.first_row[wheel, contacts.noted_circle[wheel]]
    for m in range(samples.circles):
        contacts.first_row[wheel, m] = contacts.second_row[wheel, m] = FAR_ROW
        contacts.first_gap[wheel, m] = contacts.second_gap[wheel, m] = np.inf
    contacts.block_max[wheel] = np.inf
    if scope == SearchScope.COARSE or scope == SearchScope.EXACT:
        return _scan_carefully(model, work, wheel, scope)
    rear = _find_max_below_half(model, work, wheel, -0.5)
    front = _find_max_below_half(model, work, wheel, 0.5)
    if rear < np.inf and front < np.inf:
        contacts.block_max[wheel] = max(rear, front)
        reach = CIRCLE_REACH * samples.radius if scope == SearchScope.FULL else 0.0
        _scan_inside(model, work, wheel, (rear, front), (reach, start))
        return ContactStatus.IN_CONTACT
    return _scan_carefully(model, work, wheel, scope)


@kernel
def _find_max_below_half(model, work, wheel, half):
    """Return the highest ground [m] below the rear (half -0.5) or front (0.5) half of a rim.

    Infinite where any ground there is unknown.
    """
    ground, samples, placement = model.ground, model.samples, work.placement
    forward, up, centres = placement.forward, placement.up, placement.centres
    scale = ground.inverse_resolution
    along = 0.5 * samples.radius
    # Horizontal: half the sideways shift of the lowest point by camber, plus half the width.
    aside = along * np.sqrt(up[0] * up[0] + up[1] * up[1]) + samples.half_width
    gx = centres[wheel, 0] - ground.x0 + samples.radius * (half * forward[0] - 0.5 * up[0])
    gy = centres[wheel, 1] - ground.y0 + samples.radius * (half * forward[1] - 0.5 * up[1])
    ahead_x, ahead_y = abs(forward[0]), abs(forward[1])
    return find_block_max(
        ground, gx * scale, gy * scale,
        (along * ahead_x + aside * ahead_y) * scale, (along * ahead_y + aside * ahead_x) * scale,
    )  # fmt: skip


@kernel
def _scan_inside(model, work, wheel, tops, near):
    """Sample a rim over known ground.

    A row holds the samples at one angle. The start row, where the wheel was nearest before, comes
    first. Then follow the rows from the lowest one to the rear, and to the front. A direction ends
    once the gap to the highest ground exceeds the smallest gap by more than the reach. The loop
    reads local variables, because the compiler must assume that a write may change any array.

    Args:
        model: A record with `ground` and `samples`.
        work: A record with `placement` and `contacts`.
        wheel: Index of the wheel.
        tops: Highest ground [m] below the rear half and below the front half.
        near: Reach [m], and the row of samples to start with.
    """
    ground, samples = model.ground, model.samples
    placement, contacts = work.placement, work.contacts
    rear, front = tops
    reach, start = near
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    scale, radius, circles = ground.inverse_resolution, samples.radius, samples.circles
    ahead_x, ahead_y = scale * radius * forward[0], scale * radius * forward[1]
    down_x, down_y, down_z = scale * radius * up[0], scale * radius * up[1], radius * up[2]
    across, width = samples.laterals[0], samples.lateral_spacing
    x = (centres[wheel, 0] - ground.x0 + across * R[0, 1]) * scale
    y = (centres[wheel, 1] - ground.y0 + across * R[1, 1]) * scale
    z = centres[wheel, 2] + across * R[2, 1]
    step_x, step_y, step_z = width * R[0, 1] * scale, width * R[1, 1] * scale, width * R[2, 1]
    lowest = centres[wheel, 2] - abs(samples.half_width * R[2, 1])
    best, best_m = np.inf, 0
    middle = samples.rows // 2
    k, end, turn, block_max = start, start + 1, 1, max(rear, front)
    for stretch in range(3):
        if stretch == 1:
            k, end, turn, block_max = middle, -1, -1, rear
        elif stretch == 2:
            k, end, turn, block_max = middle + 1, samples.rows, 1, front
        while k != end:
            s, c = samples.sines[k], samples.cosines[k]
            if lowest - c * down_z - block_max > best + reach:
                break
            if stretch > 0 and k == start:
                k += turn
                continue
            gx = x + s * ahead_x - c * down_x
            gy = y + s * ahead_y - c * down_y
            gz = z - c * down_z
            for m in range(circles):
                gap = gz - height_inside(ground, gx, gy)
                gx += step_x
                gy += step_y
                gz += step_z
                if gap < best + reach:
                    _note_sample(contacts, (wheel, m), k, 1, gap)
                    if gap < best:
                        best, best_m = gap, m
            k += turn
    contacts.noted_gap[wheel], contacts.noted_circle[wheel] = best, best_m


@kernel
def _note_sample(contacts, circle, k, stride, gap):
    """Note the gap of row k on a circle (wheel, m), if it is the smallest or second smallest.

    The second smallest is more than `stride` rows away from the smallest.
    """
    wheel, m = circle
    if gap < contacts.first_gap[wheel, m]:
        if abs(k - contacts.first_row[wheel, m]) > stride:
            contacts.second_gap[wheel, m] = contacts.first_gap[wheel, m]
            contacts.second_row[wheel, m] = contacts.first_row[wheel, m]
        contacts.first_gap[wheel, m], contacts.first_row[wheel, m] = gap, k
    elif gap < contacts.second_gap[wheel, m] and abs(k - contacts.first_row[wheel, m]) > stride:
        contacts.second_gap[wheel, m], contacts.second_row[wheel, m] = gap, k


@kernel
def _scan_carefully(model, work, wheel, scope):
    """Sample a rim that may be over unknown ground, off the map or next to a face.

    COARSE visits every other sample of the middle circle. EXACT refines each sample that may be
    near immediately. Returns the worst ContactStatus.
    """
    ground, samples = model.ground, model.samples
    placement, contacts = work.placement, work.contacts
    exact = scope == SearchScope.EXACT
    first, last, stride = 0, samples.circles - 1, 1
    if scope == SearchScope.COARSE:
        first, last, stride = samples.circles // 2, samples.circles // 2, 2
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    scale, radius = ground.inverse_resolution, samples.radius
    status, best, best_m = ContactStatus.IN_CONTACT, np.inf, first
    if exact:
        contacts.circle_gap[wheel, :] = np.inf
    middle = samples.rows // 2
    for visit in range((samples.rows - 1) // stride + 1):
        k = middle + stride * ((visit + 1) // 2) * (1 - 2 * (visit % 2))
        s, c = samples.sines[k], samples.cosines[k]
        for m in range(first, last + 1):
            across = samples.laterals[m]
            x = centres[wheel, 0] + across * R[0, 1] + radius * (s * forward[0] - c * up[0])
            y = centres[wheel, 1] + across * R[1, 1] + radius * (s * forward[1] - c * up[1])
            gx, gy = (x - ground.x0) * scale, (y - ground.y0) * scale
            if not is_cell_on_map(ground, gx, gy):
                status = ContactStatus.OFF_MAP
                continue
            gap = centres[wheel, 2] + across * R[2, 1] - radius * c * up[2]
            gap -= height_at_cell(ground, gx, gy)
            if gap != gap:
                if status == ContactStatus.IN_CONTACT:
                    status = ContactStatus.UNKNOWN_GROUND
                continue
            _note_sample(contacts, (wheel, m), k, stride, gap)
            middle_z = centres[wheel, 2] + across * R[2, 1]
            if (
                exact
                and gap < best + EXACT_REACH * radius
                and _may_come_near(model, work, (gx, gy, middle_z), (s, c), best)
            ):
                gap = refine_from(model, work, wheel, m, (s, c))
            if gap < best:
                best, best_m = gap, m
    contacts.noted_gap[wheel], contacts.noted_circle[wheel] = best, best_m
    if exact:
        contacts.nearest[wheel] = best_m
    return status


@kernel
def _may_come_near(model, work, place, turn, best):
    """Return whether the search of a circle from one sample may find a gap close to `best`.

    The search covers one sample spacing to both sides. It finds none if the highest cell below
    this arc is too far below the arc's lowest point.

    Args:
        model: A record with `ground` and `samples`.
        work: A record with `placement`.
        place: x and y of the sample [cells], height of the centre of its circle [m].
        turn: (sine, cosine) of the sample's angle.
        best: Smallest gap found so far [m].
    """
    ground, samples = model.ground, model.samples
    forward, up = work.placement.forward, work.placement.up
    gx, gy, z = place
    s, c = turn
    if not up[2] > 0.0:
        return True
    turn_s, turn_c = samples.spacing_sine, samples.spacing_cosine
    c_most, s_most = 1.0, min(1.0, abs(s) + turn_s)
    if abs(s) > turn_s:
        c_most = c * turn_c + abs(s) * turn_s
    # An arc is slightly longer than its sine.
    way = 1.01 * turn_s * samples.radius * ground.inverse_resolution
    reach_x = way * (abs(forward[0]) * c_most + abs(up[0]) * s_most)
    reach_y = way * (abs(forward[1]) * c_most + abs(up[1]) * s_most)
    top = -np.inf
    for i in range(max(int(gy - reach_y), 0), min(int(gy + reach_y) + 2, ground.rows)):
        for j in range(max(int(gx - reach_x), 0), min(int(gx + reach_x) + 2, ground.columns)):
            height = elevation_of(ground, i, j)
            if height > top:
                top = height
    lowest = z - samples.radius * c_most * up[2]
    return lowest - top < best + CIRCLE_REACH * samples.radius
