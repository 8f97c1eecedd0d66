# SPDX-License-Identifier: Apache-2.0
"""Scan of a wheel's rim: the vertical gaps of its samples to the ground, and the nearest ones."""

import numpy as np

from rover_physics.contact.contact_record import RIMS, SearchScope, point_of_rim
from rover_physics.numerics.kernels import kernel
from rover_physics.status import PoseStatus
from rover_physics.terrain.ground import (
    find_block_max,
    height_at_cell,
    height_inside,
    is_cell_on_map,
    to_cells,
)


@kernel
def scan_rims(model, work, wheel, scope):
    """Sample circles of a wheel.

    Args:
        model: A record with `ground` GROUND and `samples` WHEEL_SAMPLES.
        work: A record with `placement` PLACEMENT.
        wheel: Index of the wheel.
        scope: A SearchScope. COARSE visits every other sample of the middle circle, the others
            visit the rims and the middle circle.

    Returns:
        The worst PoseStatus of the samples; and the nearest one: its gap [m], infinite if there
        is none, its circle (0 right rim, 1 middle, 2 left rim), and its row.
    """
    if scope == SearchScope.COARSE:
        return scan_carefully(model, work, wheel, scope)
    rear, front = find_tops(model, work, wheel)
    if rear < np.inf and front < np.inf:
        return PoseStatus.SETTLED, _scan_inside(model, work, wheel, (rear, front))
    return scan_carefully(model, work, wheel, scope)


@kernel
def find_tops(model, work, wheel):
    """Return the highest ground [m] below the rear and below the front half of a wheel.

    Infinite where any ground there is unknown.
    """
    rear = _find_max_below_half(model, work, wheel, -0.5)
    return rear, _find_max_below_half(model, work, wheel, 0.5)


@kernel
def _find_max_below_half(model, work, wheel, half):
    """Return the highest ground [m] below the rear (half -0.5) or front (0.5) half of a rim.

    Infinite where any ground there is unknown.
    """
    ground, samples, placement = model.ground, model.samples, work.placement
    forward, up, centres = placement.forward[wheel], placement.up[wheel], placement.centres
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
def _scan_inside(model, work, wheel, tops):
    """Sample circles over known ground; return the nearest sample as `scan_rims` does.

    A row holds the samples at one angle. The rows follow from the lowest one to the rear, and to
    the front. A direction ends once the gap to the highest ground exceeds the smallest gap. The
    loop reads local variables, because the compiler must assume that a write may change any
    array.

    Args:
        model: A record with `ground` and `samples`.
        work: A record with `placement`.
        wheel: Index of the wheel.
        tops: Highest ground [m] below the rear half and below the front half.
    """
    ground, samples, placement = model.ground, model.samples, work.placement
    rear, front = tops
    middle, best = samples.rows // 2, np.inf
    axis, centres = placement.axis[wheel], placement.centres
    forward, up = placement.forward[wheel], placement.up[wheel]
    scale, radius = ground.inverse_resolution, samples.radius
    ahead_x, ahead_y = scale * radius * forward[0], scale * radius * forward[1]
    down_x, down_y, down_z = scale * radius * up[0], scale * radius * up[1], radius * up[2]
    across, width = -samples.half_width, samples.half_width
    x = (centres[wheel, 0] - ground.x0 + across * axis[0]) * scale
    y = (centres[wheel, 1] - ground.y0 + across * axis[1]) * scale
    z = centres[wheel, 2] + across * axis[2]
    step_x, step_y, step_z = width * axis[0] * scale, width * axis[1] * scale, width * axis[2]
    lowest = centres[wheel, 2] - abs(samples.half_width * axis[2])
    best_rim, best_row = 0, middle
    k, end, turn, top = middle, -1, -1, rear
    for direction in range(2):
        if direction == 1:
            k, end, turn, top = middle + 1, samples.rows, 1, front
        while k != end:
            s, c = samples.sines[k], samples.cosines[k]
            if lowest - c * down_z - top > best:
                break
            gx = x + s * ahead_x - c * down_x
            gy = y + s * ahead_y - c * down_y
            gz = z - c * down_z
            for rim in range(RIMS):
                gap = gz - height_inside(ground, gx, gy)
                gx += step_x
                gy += step_y
                gz += step_z
                if gap < best:
                    best, best_rim, best_row = gap, rim, k
            k += turn
    return best, best_rim, best_row


@kernel
def scan_carefully(model, work, wheel, scope):
    """Sample circles that may be over unknown ground or off the map.

    COARSE visits every other sample of the middle circle. Returns what `scan_rims` returns.
    """
    samples = model.samples
    first, last, stride = 0, RIMS - 1, 1
    if scope == SearchScope.COARSE:
        first, last, stride = 1, 1, 2
    middle = samples.rows // 2
    status, best, best_rim, best_row = PoseStatus.SETTLED, np.inf, first, middle
    for visit in range((samples.rows - 1) // stride + 1):
        k = middle + stride * ((visit + 1) // 2) * (1 - 2 * (visit % 2))
        turn = samples.sines[k], samples.cosines[k]
        for rim in range(first, last + 1):
            circle = wheel, (rim - 1) * samples.half_width
            gap, (gx, gy) = find_gap(model, work, circle, turn)
            if gap < best:
                best, best_rim, best_row = gap, rim, k
            elif gap != gap and not is_cell_on_map(model.ground, gx, gy):
                status = PoseStatus.OFF_MAP
            elif gap != gap and status == PoseStatus.SETTLED:
                status = PoseStatus.UNKNOWN_GROUND
    return status, (best, best_rim, best_row)


@kernel
def find_gap(model, work, circle, turn):
    """Return the gap [m] at one point of the rim, NaN if unknown, and its place (x, y) [cells].

    `circle` is (wheel, distance from its middle plane [m]), `turn` (sine, cosine) of the contact
    angle.
    """
    x, y, z = point_of_rim(model.samples.radius, work.placement, circle, turn)
    gx, gy = to_cells(model.ground, x, y)
    if not is_cell_on_map(model.ground, gx, gy):
        return np.nan, (gx, gy)
    return z - height_at_cell(model.ground, gx, gy), (gx, gy)
