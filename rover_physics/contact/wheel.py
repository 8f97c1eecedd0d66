"""A rigid cylindrical wheel on the terrain: its vertical gap, where it touches and in what frame.

The lower half of the cylinder is sampled in the wheel's own, cambered plane: on circles across its
width and angles along each circle. The smallest vertical gap between sample and terrain is the gap
of the wheel; it is refined along the circle by the root of its derivative. Contact angles count
from the lowest point of the circle, positive towards the front, so a wheel climbing has positive
angles.
"""

import numpy as np

from rover_physics.contact.circle_search import refine_circle, refine_others
from rover_physics.contact.contact_record import AGAIN, COARSE, FULL, NEAR, QUICK, TOUCHING
from rover_physics.contact.rim_scan import scan_rim
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import height_inside

COMPLIANCE = 2e-3
"""Depth, in wheel radii, to which real wheels and ground give way: circles with gaps closer than
that share the load. On a plane a wheel thus touches in its middle, not on an edge at random."""


@kernel
def find_touch(ground, samples, placement, wheel, scope, touch):
    """Find where `wheel` is nearest to the ground and write it into row `wheel` of `touch`.

    `scope` says how thoroughly: COARSE looks at every other sample of the middle circle, QUICK
    at all samples and closer at the nearest, NEAR only around the direction found last, FULL also
    at all samples and closer at each other circle that comes near to that, AGAIN only at those
    that FULL found near, EXACT closer at each local minimum of each circle. FULL and AGAIN come
    after QUICK or NEAR at the same placement, AGAIN after FULL at a placement that differs
    little. Returns TOUCHING, or OFF_MAP or UNKNOWN_GROUND where any sample lies there; such
    samples are passed over, and the gap is NaN where there is no other.
    """
    status = TOUCHING
    if touch.held_height[wheel] == touch.held_height[wheel]:
        _hold(placement, wheel, touch)
        return status
    if scope == COARSE and _guess(ground, samples, placement, wheel, touch):
        return status
    if scope != NEAR and scope != AGAIN:
        status = scan_rim(ground, samples, placement, wheel, scope, touch)
        if touch.noted_gap[wheel] == np.inf:
            touch.gap[wheel] = np.nan
            return status
        if scope in (COARSE, QUICK):
            _take_sample(samples, wheel, touch)
    if scope in (QUICK, NEAR):
        refine_circle(ground, samples, placement, wheel, touch.nearest[wheel], touch)
    elif scope in (FULL, AGAIN):
        refine_others(ground, samples, placement, wheel, touch)
    _write_touch(samples, placement, wheel, touch)
    return status


@kernel
def _guess(ground, samples, placement, wheel, touch):
    """Write the nearest of some samples of the middle circle; False near unknown ground."""
    forward, up, centres = placement.forward, placement.up, placement.centres
    scale, radius = ground.inverse_resolution, samples.radius
    gx, gy = (centres[wheel, 0] - ground.x0) * scale, (centres[wheel, 1] - ground.y0) * scale
    reach = radius * scale
    if not (
        gx >= reach
        and gy >= reach
        and gx < ground.columns - 1 - reach
        and gy < ground.rows - 1 - reach
    ):
        return False
    ahead_x, ahead_y = reach * forward[0], reach * forward[1]
    down_x, down_y, down_z = reach * up[0], reach * up[1], radius * up[2]
    nearest, row, total = np.inf, 0, 0.0
    for k in range(samples.rows // 2 % 2, samples.rows, 2):
        s, c = samples.sines[k], samples.cosines[k]
        dx, dy = s * ahead_x - c * down_x, s * ahead_y - c * down_y
        height = height_inside(ground, gx + dx, gy + dy)
        gap = -c * down_z - height
        total += height
        row = k if gap < nearest else row
        nearest = min(nearest, gap)
    if total != total:
        return False
    touch.gap[wheel] = centres[wheel, 2] + nearest
    write_point(samples, placement, wheel, samples.sines[row], samples.cosines[row], 0.0, touch)
    return True


@kernel
def _take_sample(samples, wheel, touch):
    """Take the nearest sample for the place where the wheel touches."""
    m = touch.noted_circle[wheel]
    k = touch.first_row[wheel, m]
    touch.nearest[wheel] = m
    touch.circle_gap[wheel, m] = touch.noted_gap[wheel]
    touch.circle_sine[wheel, m] = samples.sines[k]
    touch.circle_cosine[wheel, m] = samples.cosines[k]
    touch.circle_slope[wheel, m, :] = 0.0


@kernel
def _write_touch(samples, placement, wheel, touch):
    """Write gap, point and normal of a wheel on its nearest circle."""
    m = touch.nearest[wheel]
    touch.gap[wheel] = touch.circle_gap[wheel, m]
    s, c = touch.circle_sine[wheel, m], touch.circle_cosine[wheel, m]
    write_point(samples, placement, wheel, s, c, samples.laterals[m], touch)
    slope = touch.circle_slope[wheel, m]
    write_normal(placement, wheel, s, c, slope[0], slope[1], touch)


@kernel
def _hold(placement, wheel, touch):
    """Write the touch of a wheel whose centre is held at a height, whatever the ground."""
    touch.gap[wheel] = placement.centres[wheel, 2] - touch.held_height[wheel]
    for i in range(3):
        touch.point[wheel, i] = placement.centres[wheel, i]
        touch.normal[wheel, i] = 0.0
    touch.normal[wheel, 2] = 1.0


@kernel
def find_contact(samples, placement, wheel, touch):
    """Replace the touch of `wheel` by the mean contact over the circles that share the load.

    Each circle counts by how far its own touching point stays below the lowest plus COMPLIANCE
    radii. The touch has to come from a FULL or EXACT `find_touch`.
    """
    if touch.held_height[wheel] == touch.held_height[wheel]:
        s, c = np.sin(touch.held_angle[wheel]), np.cos(touch.held_angle[wheel])
        write_point(samples, placement, wheel, s, c, 0.0, touch)
        return
    allowance = COMPLIANCE * samples.radius
    total, sine_sum, cosine_sum, lateral_sum = 0.0, 0.0, 0.0, 0.0
    for m in range(samples.circles):
        weight = 1.0 - (touch.circle_gap[wheel, m] - touch.gap[wheel]) / allowance
        if weight > 0.0:
            total += weight
            sine_sum += weight * touch.circle_sine[wheel, m]
            cosine_sum += weight * touch.circle_cosine[wheel, m]
            lateral_sum += weight * samples.laterals[m]
    length = np.sqrt(sine_sum * sine_sum + cosine_sum * cosine_sum)
    s, c = sine_sum / length, cosine_sum / length
    write_point(samples, placement, wheel, s, c, lateral_sum / total, touch)


@kernel
def write_point(samples, placement, wheel, s, c, lateral, touch):
    """Write the point of the cylinder at the angle of sine s and cosine c and at `lateral`."""
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    touch.sine[wheel], touch.cosine[wheel] = s, c
    for i in range(3):
        radial = samples.radius * (s * forward[i] - c * up[i])
        touch.point[wheel, i] = centres[wheel, i] + lateral * R[i, 1] + radial


@kernel
def write_normal(placement, wheel, s, c, slope_x, slope_y, touch):
    """Write the wheel's radial direction with the terrain's slope along the axis, scaled to z = 1.

    The part of the terrain's normal along the circle is left out: it vanishes where wheel and
    ground are tangent, and where the wheel rests on an edge the wheel's own radius is the
    normal.
    """
    R, forward, up, normal = placement.R, placement.forward, placement.up, touch.normal
    radial_x = -s * forward[0] + c * up[0]
    radial_y = -s * forward[1] + c * up[1]
    radial_z = c * up[2]
    along_radius = radial_z - slope_x * radial_x - slope_y * radial_y
    along_axis = R[2, 1] - slope_x * R[0, 1] - slope_y * R[1, 1]
    z = max(along_radius * radial_z + along_axis * R[2, 1], 0.02 * along_radius)
    normal[wheel, 0] = (along_radius * radial_x + along_axis * R[0, 1]) / z
    normal[wheel, 1] = (along_radius * radial_y + along_axis * R[1, 1]) / z
    normal[wheel, 2] = 1.0
