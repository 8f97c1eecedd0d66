"""A rigid cylindrical wheel on the terrain: its vertical gap, where it touches and in what frame.

The lower half of the cylinder is sampled in the wheel's own, cambered plane: on circles across its
width and angles along each circle. The smallest vertical gap between sample and terrain is the gap
of the wheel; it is refined along the circle by the root of its derivative. Contact angles count
from the lowest point of the circle, positive towards the front, so a wheel climbing has positive
angles.
"""

import numpy as np

from rover_physics.contact.circle_search import refine_circle, refine_others
from rover_physics.contact.contact_record import AGAIN, COARSE, FULL, IN_CONTACT, NEAR, QUICK
from rover_physics.contact.rim_scan import scan_rim
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import height_inside

COMPLIANCE = 2e-3
"""Depth, in wheel radii, to which real wheels and ground give way: circles with gaps closer than
that share the load. On a plane a wheel thus touches in its middle, not on an edge at random."""


@kernel
def find_contact(ground, samples, placement, wheel, scope, contacts):
    """Find where `wheel` is nearest to the ground and write it into row `wheel` of `touch`.

    `scope` says how thoroughly: COARSE looks at every other sample of the middle circle, QUICK
    at all samples and closer at the nearest, NEAR only around the direction found last, FULL also
    at all samples and closer at each other circle that comes near to that, AGAIN only at those
    that FULL found near, EXACT closer at each local minimum of each circle. FULL and AGAIN come
    after QUICK or NEAR at the same placement, AGAIN after FULL at a placement that differs
    little. Returns IN_CONTACT, or OFF_MAP or UNKNOWN_GROUND where any sample lies there; such
    samples are passed over, and the gap is NaN where there is no other.
    """
    status = IN_CONTACT
    if contacts.held_height[wheel] == contacts.held_height[wheel]:
        _hold(placement, wheel, contacts)
        return status
    if scope == COARSE and _guess(ground, samples, placement, wheel, contacts):
        return status
    if scope != NEAR and scope != AGAIN:
        status = scan_rim(ground, samples, placement, wheel, scope, contacts)
        if contacts.noted_gap[wheel] == np.inf:
            contacts.gap[wheel] = np.nan
            return status
        if scope in (COARSE, QUICK):
            _take_sample(samples, wheel, contacts)
    if scope in (QUICK, NEAR):
        refine_circle(ground, samples, placement, wheel, contacts.nearest[wheel], contacts)
    elif scope in (FULL, AGAIN):
        refine_others(ground, samples, placement, wheel, contacts)
    _write_contact(samples, placement, wheel, contacts)
    return status


@kernel
def _guess(ground, samples, placement, wheel, contacts):
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
    contacts.gap[wheel] = centres[wheel, 2] + nearest
    write_point(samples, placement, wheel, samples.sines[row], samples.cosines[row], 0.0, contacts)
    return True


@kernel
def _take_sample(samples, wheel, contacts):
    """Take the nearest sample for the place where the wheel touches."""
    m = contacts.noted_circle[wheel]
    k = contacts.first_row[wheel, m]
    contacts.nearest[wheel] = m
    contacts.circle_gap[wheel, m] = contacts.noted_gap[wheel]
    contacts.circle_sine[wheel, m] = samples.sines[k]
    contacts.circle_cosine[wheel, m] = samples.cosines[k]
    contacts.circle_slope[wheel, m, :] = 0.0


@kernel
def _write_contact(samples, placement, wheel, contacts):
    """Write gap, point and normal of a wheel on its nearest circle."""
    m = contacts.nearest[wheel]
    contacts.gap[wheel] = contacts.circle_gap[wheel, m]
    s, c = contacts.circle_sine[wheel, m], contacts.circle_cosine[wheel, m]
    write_point(samples, placement, wheel, s, c, samples.laterals[m], contacts)
    slope = contacts.circle_slope[wheel, m]
    write_normal(placement, wheel, s, c, slope[0], slope[1], contacts)


@kernel
def _hold(placement, wheel, contacts):
    """Write the touch of a wheel whose centre is held at a height, whatever the ground."""
    contacts.gap[wheel] = placement.centres[wheel, 2] - contacts.held_height[wheel]
    for i in range(3):
        contacts.point[wheel, i] = placement.centres[wheel, i]
        contacts.normal[wheel, i] = 0.0
    contacts.normal[wheel, 2] = 1.0


@kernel
def blend_contact(samples, placement, wheel, contacts):
    """Replace the touch of `wheel` by the mean contact over the circles that share the load.

    Each circle counts by how far its own touching point stays below the lowest plus COMPLIANCE
    radii. The contact has to come from a FULL or EXACT `find_contact`.
    """
    if contacts.held_height[wheel] == contacts.held_height[wheel]:
        s, c = np.sin(contacts.held_angle[wheel]), np.cos(contacts.held_angle[wheel])
        write_point(samples, placement, wheel, s, c, 0.0, contacts)
        return
    allowance = COMPLIANCE * samples.radius
    total, sine_sum, cosine_sum, lateral_sum = 0.0, 0.0, 0.0, 0.0
    for m in range(samples.circles):
        weight = 1.0 - (contacts.circle_gap[wheel, m] - contacts.gap[wheel]) / allowance
        if weight > 0.0:
            total += weight
            sine_sum += weight * contacts.circle_sine[wheel, m]
            cosine_sum += weight * contacts.circle_cosine[wheel, m]
            lateral_sum += weight * samples.laterals[m]
    length = np.sqrt(sine_sum * sine_sum + cosine_sum * cosine_sum)
    s, c = sine_sum / length, cosine_sum / length
    write_point(samples, placement, wheel, s, c, lateral_sum / total, contacts)


@kernel
def write_point(samples, placement, wheel, s, c, lateral, contacts):
    """Write the point of the cylinder at the angle of sine s and cosine c and at `lateral`."""
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    contacts.sine[wheel], contacts.cosine[wheel] = s, c
    for i in range(3):
        radial = samples.radius * (s * forward[i] - c * up[i])
        contacts.point[wheel, i] = centres[wheel, i] + lateral * R[i, 1] + radial


@kernel
def write_normal(placement, wheel, s, c, slope_x, slope_y, contacts):
    """Write the wheel's radial direction with the terrain's slope along the axis, scaled to z = 1.

    The part of the terrain's normal along the circle is left out: it vanishes where wheel and
    ground are tangent, and where the wheel rests on an edge the wheel's own radius is the
    normal.
    """
    R, forward, up, normal = placement.R, placement.forward, placement.up, contacts.normal
    radial_x = -s * forward[0] + c * up[0]
    radial_y = -s * forward[1] + c * up[1]
    radial_z = c * up[2]
    along_radius = radial_z - slope_x * radial_x - slope_y * radial_y
    along_axis = R[2, 1] - slope_x * R[0, 1] - slope_y * R[1, 1]
    z = max(along_radius * radial_z + along_axis * R[2, 1], 0.02 * along_radius)
    normal[wheel, 0] = (along_radius * radial_x + along_axis * R[0, 1]) / z
    normal[wheel, 1] = (along_radius * radial_y + along_axis * R[1, 1]) / z
    normal[wheel, 2] = 1.0
