"""Contact of a rigid cylindrical wheel with the terrain: vertical gap, contact point and normal.

The lower half of the cylinder is sampled in the wheel's own, cambered plane: on circles across its
width, at angles along each circle. The gap of the wheel is the smallest vertical gap between a
sample and the terrain. It is refined along the circle by the root of its derivative. Contact
angles are measured from the lowest point of the circle, positive towards the front, so a climbing
wheel has a positive angle.
"""

import numpy as np

from rover_physics.contact.circle_search import refine_circle, refine_others
from rover_physics.contact.contact_record import SearchScope
from rover_physics.contact.rim_scan import scan_rim
from rover_physics.numerics.kernels import kernel
from rover_physics.status import ContactStatus
from rover_physics.terrain.ground import height_inside

COMPLIANCE = 2e-3
"""Deformation of real wheels and ground [wheel radii]. Circles whose gaps differ by less share the
load, so on a plane a wheel touches in its middle, not at a random edge."""


@kernel
def find_contact(model, work, wheel, scope):
    """Find the contact of a wheel and write it into row `wheel` of the contacts.

    FULL and AGAIN require QUICK or NEAR at the same placement before; AGAIN also requires FULL at
    a placement that differs little. Samples over unknown ground or off the map are skipped; the
    gap is NaN if no sample is left.

    Args:
        model: A record with `ground` GROUND and `samples` WHEEL_SAMPLES.
        work: A record with `placement` PLACEMENT, written by `place`, and `contacts` CONTACTS.
        wheel: Index of the wheel.
        scope: A SearchScope.

    Returns:
        The worst ContactStatus of the samples.
    """
    contacts = work.contacts
    status = ContactStatus.IN_CONTACT
    if contacts.held_height[wheel] == contacts.held_height[wheel]:
        _hold(work, wheel)
        return status
    if scope == SearchScope.COARSE and _guess(model, work, wheel):
        return status
    if scope != SearchScope.NEAR and scope != SearchScope.AGAIN:
        status = scan_rim(model, work, wheel, scope)
        if contacts.noted_gap[wheel] == np.inf:
            contacts.gap[wheel] = np.nan
            return status
        if scope == SearchScope.COARSE or scope == SearchScope.QUICK:
            _take_sample(model.samples, contacts, wheel)
    if scope == SearchScope.QUICK or scope == SearchScope.NEAR:
        refine_circle(model, work, wheel, contacts.nearest[wheel])
    elif scope == SearchScope.FULL or scope == SearchScope.AGAIN:
        refine_others(model, work, wheel)
    _write_contact(model.samples, work, wheel)
    return status


@kernel
def _guess(model, work, wheel):
    """Write the nearest of every other sample of the middle circle; False near unknown ground."""
    ground, samples, placement = model.ground, model.samples, work.placement
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
    work.contacts.gap[wheel] = centres[wheel, 2] + nearest
    write_point(samples, work, wheel, (samples.sines[row], samples.cosines[row]), 0.0)
    return True


@kernel
def _take_sample(samples, contacts, wheel):
    """Take the nearest sample as the contact."""
    m = contacts.noted_circle[wheel]
    k = contacts.first_row[wheel, m]
    contacts.nearest[wheel] = m
    contacts.circle_gap[wheel, m] = contacts.noted_gap[wheel]
    contacts.circle_sine[wheel, m] = samples.sines[k]
    contacts.circle_cosine[wheel, m] = samples.cosines[k]
    contacts.circle_slope[wheel, m, :] = 0.0


@kernel
def _write_contact(samples, work, wheel):
    """Write gap, point and normal of a wheel on its nearest circle."""
    contacts = work.contacts
    m = contacts.nearest[wheel]
    contacts.gap[wheel] = contacts.circle_gap[wheel, m]
    turn = contacts.circle_sine[wheel, m], contacts.circle_cosine[wheel, m]
    write_point(samples, work, wheel, turn, samples.laterals[m])
    slope = contacts.circle_slope[wheel, m]
    write_normal(work, wheel, turn, (slope[0], slope[1]))


@kernel
def _hold(work, wheel):
    """Write the contact of a wheel whose centre is held at a height, regardless of the ground."""
    centres, contacts = work.placement.centres, work.contacts
    contacts.gap[wheel] = centres[wheel, 2] - contacts.held_height[wheel]
    for i in range(3):
        contacts.point[wheel, i] = centres[wheel, i]
        contacts.normal[wheel, i] = 0.0
    contacts.normal[wheel, 2] = 1.0


@kernel
def blend_contact(samples, work, wheel):
    """Replace the contact of `wheel` by the weighted mean of the circles that share the load.

    The weight of a circle falls linearly from 1 at the smallest gap to 0 at COMPLIANCE radii above
    it. A held wheel gets the angle of its face. `find_contact` must have run with FULL, AGAIN or
    EXACT before.
    """
    contacts = work.contacts
    if contacts.held_height[wheel] == contacts.held_height[wheel]:
        s, c = np.sin(contacts.held_angle[wheel]), np.cos(contacts.held_angle[wheel])
        write_point(samples, work, wheel, (s, c), 0.0)
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
    turn = sine_sum / length, cosine_sum / length
    write_point(samples, work, wheel, turn, lateral_sum / total)


@kernel
def write_point(samples, work, wheel, turn, lateral):
    """Write a point of the cylinder [m], map frame, and its contact angle into the contacts.

    `turn` is (sine, cosine) of the contact angle, `lateral` the distance from the middle plane
    [m], positive to the left.
    """
    placement, contacts = work.placement, work.contacts
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    s, c = turn
    contacts.sine[wheel], contacts.cosine[wheel] = s, c
    for i in range(3):
        radial = samples.radius * (s * forward[i] - c * up[i])
        contacts.point[wheel, i] = centres[wheel, i] + lateral * R[i, 1] + radial


@kernel
def write_normal(work, wheel, turn, slope):
    """Write the contact normal: the wheel's radius, tilted by the terrain's slope along the axle.

    It is scaled to z = 1, map frame. `turn` is (sine, cosine) of the contact angle, `slope` that
    of the ground along x and y. The component of the terrain's normal along the circle is left
    out: it is zero where wheel and ground are tangent, and on an edge the wheel's radius is the
    normal.
    """
    placement, normal = work.placement, work.contacts.normal
    R, forward, up = placement.R, placement.forward, placement.up
    s, c = turn
    slope_x, slope_y = slope
    radial_x = -s * forward[0] + c * up[0]
    radial_y = -s * forward[1] + c * up[1]
    radial_z = c * up[2]
    along_radius = radial_z - slope_x * radial_x - slope_y * radial_y
    along_axis = R[2, 1] - slope_x * R[0, 1] - slope_y * R[1, 1]
    z = max(along_radius * radial_z + along_axis * R[2, 1], 0.02 * along_radius)
    normal[wheel, 0] = (along_radius * radial_x + along_axis * R[0, 1]) / z
    normal[wheel, 1] = (along_radius * radial_y + along_axis * R[1, 1]) / z
    normal[wheel, 2] = 1.0
