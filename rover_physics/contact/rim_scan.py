"""All samples of a wheel's rim held against the ground: which of them are near."""

import numpy as np

from rover_physics.contact.circle_search import refine_from
from rover_physics.contact.contact_record import (
    CIRCLE_REACH,
    COARSE,
    EXACT,
    FAR_ROW,
    FULL,
    IN_CONTACT,
    OFF_MAP,
    UNKNOWN_GROUND,
)
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import (
    elevation_of,
    find_block_max,
    height_at_cell,
    height_inside,
    is_cell_on_map,
)

EXACT_REACH = 0.5
"""How far above the nearest sample, in wheel radii, an exact search still refines others: beside
a face much can lie between two samples."""


@kernel
def scan_rim(ground, samples, placement, wheel, scope, contacts):
    """Sample the rim; write the nearest samples into `touch` and return the worst status."""
    start = samples.rows // 2
    if scope == FULL:
        start = contacts.first_row[wheel, contacts.noted_circle[wheel]]
    for m in range(samples.circles):
        contacts.first_row[wheel, m] = contacts.second_row[wheel, m] = FAR_ROW
        contacts.first_gap[wheel, m] = contacts.second_gap[wheel, m] = np.inf
    contacts.block_max[wheel] = np.inf
    if scope == COARSE:
        middle = samples.circles // 2
        return _scan_carefully(
            ground, samples, placement, wheel, False, middle, middle, 2, contacts
        )
    if scope != EXACT:
        rear = _find_max_below_half(ground, samples, placement, wheel, -0.5)
        front = _find_max_below_half(ground, samples, placement, wheel, 0.5)
        if rear < np.inf and front < np.inf:
            contacts.block_max[wheel] = max(rear, front)
            reach = CIRCLE_REACH * samples.radius if scope == FULL else 0.0
            _scan_inside(ground, samples, placement, wheel, rear, front, reach, start, contacts)
            return IN_CONTACT
    last = samples.circles - 1
    return _scan_carefully(ground, samples, placement, wheel, scope == EXACT, 0, last, 1, contacts)


@kernel
def _find_max_below_half(ground, samples, placement, wheel, half):
    """Return the highest ground [m] below the rear (half -0.5) or front (0.5) half of a rim.

    Infinite where any ground there is unknown.
    """
    forward, up, centres = placement.forward, placement.up, placement.centres
    scale = ground.inverse_resolution
    along = 0.5 * samples.radius
    # In the plane: half the lowest point's way aside with camber, and half the wheel's width.
    aside = along * np.sqrt(up[0] * up[0] + up[1] * up[1]) + samples.half_width
    gx = centres[wheel, 0] - ground.x0 + samples.radius * (half * forward[0] - 0.5 * up[0])
    gy = centres[wheel, 1] - ground.y0 + samples.radius * (half * forward[1] - 0.5 * up[1])
    ahead_x, ahead_y = abs(forward[0]), abs(forward[1])
    return find_block_max(
        ground, gx * scale, gy * scale,
        (along * ahead_x + aside * ahead_y) * scale, (along * ahead_y + aside * ahead_x) * scale,
    )  # fmt: skip


@kernel
def _scan_inside(ground, samples, placement, wheel, rear, front, reach, start, contacts):
    """Sample a rim over known ground, none of it higher than `rear` and `front` [m].

    Rows of samples at one angle are visited: `start`, where the wheel was nearest before, then
    from the lowest one to the rear and to the front, until even the highest ground
    is farther below than the nearest sample, by `reach` [m]. What the loop reads is in local
    variables: the compiler must take it that anything written may lie anywhere.
    """
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
                    _note_sample(wheel, m, k, 1, gap, contacts)
                    if gap < best:
                        best, best_m = gap, m
            k += turn
    contacts.noted_gap[wheel], contacts.noted_circle[wheel] = best, best_m


@kernel
def _note_sample(wheel, m, k, stride, gap, contacts):
    """Note a near sample of row k on circle m: the nearest, or the nearest away from that."""
    if gap < contacts.first_gap[wheel, m]:
        if abs(k - contacts.first_row[wheel, m]) > stride:
            contacts.second_gap[wheel, m] = contacts.first_gap[wheel, m]
            contacts.second_row[wheel, m] = contacts.first_row[wheel, m]
        contacts.first_gap[wheel, m], contacts.first_row[wheel, m] = gap, k
    elif gap < contacts.second_gap[wheel, m] and abs(k - contacts.first_row[wheel, m]) > stride:
        contacts.second_gap[wheel, m], contacts.second_row[wheel, m] = gap, k


@kernel
def _scan_carefully(ground, samples, placement, wheel, exact, first, last, stride, contacts):
    """Sample a rim that may be over unknown ground, beyond the map or beside a face.

    Where `exact`, each sample that may be near is refined at once. Returns the worst status.
    """
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    scale, radius = ground.inverse_resolution, samples.radius
    status, best, best_m = IN_CONTACT, np.inf, first
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
                status = OFF_MAP
                continue
            gap = centres[wheel, 2] + across * R[2, 1] - radius * c * up[2]
            gap -= height_at_cell(ground, gx, gy)
            if gap != gap:
                if status == IN_CONTACT:
                    status = UNKNOWN_GROUND
                continue
            _note_sample(wheel, m, k, stride, gap, contacts)
            if exact and gap < best + EXACT_REACH * radius and _may_come_near(
                ground, samples, forward, up, gx, gy,
                centres[wheel, 2] + across * R[2, 1], s, c, best,
            ):  # fmt: skip
                gap = refine_from(ground, samples, placement, wheel, m, s, c, contacts)
            if gap < best:
                best, best_m = gap, m
    contacts.noted_gap[wheel], contacts.noted_circle[wheel] = best, best_m
    if exact:
        contacts.nearest[wheel] = best_m
    return status


@kernel
def _may_come_near(ground, samples, forward, up, gx, gy, z, s, c, best):
    """Tell whether a search of a circle from its sample at (s, c) may come near to `best` [m].

    The sample is over (gx, gy), in cells, and the middle of the circle at the height z [m]. Not
    where the highest cell below the stretch that is searched, a spacing to both sides, stays too
    far below the lowest place of that stretch.
    """
    if not up[2] > 0.0:
        return True
    turn_s, turn_c = samples.spacing_sine, samples.spacing_cosine
    c_most, s_most = 1.0, min(1.0, abs(s) + turn_s)
    if abs(s) > turn_s:
        c_most = c * turn_c + abs(s) * turn_s
    # The arc is a little longer than its sine.
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
