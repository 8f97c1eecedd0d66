# SPDX-License-Identifier: Apache-2.0
"""Contact of a rigid cylindrical wheel with the terrain: vertical gap, contact point and normal.

The lower half of the cylinder is sampled in the wheel's own, cambered plane: on circles across its
width, at angles along each circle. The gap of the wheel is the smallest vertical gap between a
sample and the terrain. It is refined along the circle by the root of its derivative. Contact
angles are measured from the lowest point of the circle, positive towards the front, so a climbing
wheel has a positive angle.
"""

import numpy as np

from rover_physics.contact.cell_search import look_everywhere
from rover_physics.contact.contact_record import SearchScope, write_point
from rover_physics.contact.rim_scan import find_tops, scan_carefully, scan_rims
from rover_physics.contact.tracking import (
    follow_contact,
    keep_contact,
    look_at_kept,
    search_circle,
)
from rover_physics.numerics.kernels import kernel
from rover_physics.status import PoseStatus
from rover_physics.terrain.ground import height_inside, to_cells

COMPLIANCE = 2e-3
"""Deformation of real wheels and ground [wheel radii]. Circles whose gaps differ by less share the
load, so on a plane a wheel touches in its middle, not at a random edge."""
LEAST_RISE = 0.02
"""Least vertical part of a contact normal, so that a wheel at a wall has finite derivatives."""
CIRCLE_GAP = 2e-2
"""Gap above the smallest one [wheel radii], at the contact angle, up to which another circle is
searched for its share."""


@kernel
def find_contact(model, work, wheel, scope):
    """Find the contact of a wheel and write it into row `wheel` of the contacts.

    FULL requires QUICK or NEAR at the same placement before. Ground that is unknown or off the map
    is skipped; the gap is NaN if none is left.

    Args:
        model: A record with `ground` GROUND and `samples` WHEEL_SAMPLES.
        work: A record with `placement` PLACEMENT, written by `place`, `contacts` CONTACTS, and
            `cells` CELL_SEARCH.
        wheel: Index of the wheel.
        scope: A SearchScope.

    Returns:
        The worst PoseStatus of the ground below the wheel.
    """
    contacts = work.contacts
    status = PoseStatus.SETTLED
    if contacts.held_height[wheel] == contacts.held_height[wheel]:
        _hold(work, wheel)
        return status
    if scope == SearchScope.COARSE and _guess(model, work, wheel):
        return status
    lost = scope == SearchScope.NEAR and not follow_contact(model, work, wheel)
    if lost:
        keep_contact(contacts, wheel)
    elif scope == SearchScope.QUICK:
        contacts.kept[wheel] = 0
    if lost or (scope != SearchScope.NEAR and scope != SearchScope.FULL):
        status, nearest = scan_rims(model, work, wheel, scope)
        if nearest[0] == np.inf:
            contacts.gap[wheel] = np.nan
            return status
        _take_sample(model.samples, contacts, wheel, nearest)
        if scope != SearchScope.COARSE:
            follow_contact(model, work, wheel)
    if scope == SearchScope.NEAR:
        look_at_kept(model, work, wheel)
    if scope == SearchScope.FULL or scope == SearchScope.WHOLE:
        rear, front = find_tops(model, work, wheel)
        if scope == SearchScope.FULL and not (rear < np.inf and front < np.inf):
            status = scan_carefully(model, work, wheel, scope)[0]
        below = look_everywhere(model, work, wheel, (rear, front))
        if status == PoseStatus.SETTLED:
            status = below
    _write_contact(work, wheel, model.samples)
    return status


@kernel
def _guess(model, work, wheel):
    """Write the nearest of every other sample of the middle circle; False near unknown ground."""
    ground, samples, placement = model.ground, model.samples, work.placement
    forward, up, centres = placement.forward[wheel], placement.up[wheel], placement.centres
    scale, radius = ground.inverse_resolution, samples.radius
    gx, gy = to_cells(ground, centres[wheel, 0], centres[wheel, 1])
    size = radius * scale
    if not (
        gx >= size
        and gy >= size
        and gx < ground.columns - 1 - size
        and gy < ground.rows - 1 - size
    ):
        return False
    ahead_x, ahead_y = size * forward[0], size * forward[1]
    down_x, down_y, down_z = size * up[0], size * up[1], radius * up[2]
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
    work.contacts.across[wheel], work.contacts.inside[wheel] = 0.0, 0
    write_point(samples.radius, work, wheel, (samples.sines[row], samples.cosines[row]), 0.0)
    return True


@kernel
def _take_sample(samples, contacts, wheel, nearest):
    """Take the nearest sample, (gap, circle, row), as the contact."""
    gap, rim, k = nearest
    contacts.across[wheel], contacts.inside[wheel] = (rim - 1) * samples.half_width, 0
    contacts.gap[wheel] = gap
    contacts.sine[wheel], contacts.cosine[wheel] = samples.sines[k], samples.cosines[k]
    contacts.slope[wheel, 0] = contacts.slope[wheel, 1] = 0.0


@kernel
def _write_contact(work, wheel, samples):
    """Write point and normal of a wheel's contact.

    A peak between the rims pushes along the wheel's radius, whatever the slopes at its sides.
    """
    contacts = work.contacts
    turn = contacts.sine[wheel], contacts.cosine[wheel]
    write_point(samples.radius, work, wheel, turn, contacts.across[wheel])
    if contacts.inside[wheel]:
        _write_radial_normal(work, wheel, turn)
    else:
        write_normal(work, wheel, turn, (contacts.slope[wheel, 0], contacts.slope[wheel, 1]))


@kernel
def _write_radial_normal(work, wheel, turn):
    """Write the wheel's radius as the contact normal, scaled to z = 1."""
    placement, normal = work.placement, work.contacts.normal
    forward, up = placement.forward[wheel], placement.up[wheel]
    s, c = turn
    z = max(c * up[2], LEAST_RISE)
    normal[wheel, 0] = (-s * forward[0] + c * up[0]) / z
    normal[wheel, 1] = (-s * forward[1] + c * up[1]) / z
    normal[wheel, 2] = 1.0


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
def blend_contact(model, work, wheel):
    """Replace the contact of `wheel` by the weighted mean of the circles that share the load.

    The weight of a circle falls linearly from 1 at the smallest gap to 0 at COMPLIANCE radii above
    it. A peak between the rims has the weight that the nearest circle lacks. A held wheel gets
    the angle of its face.
    """
    samples, contacts = model.samples, work.contacts
    if contacts.held_height[wheel] == contacts.held_height[wheel]:
        s, c = np.sin(contacts.held_angle[wheel]), np.cos(contacts.held_angle[wheel])
        write_point(samples.radius, work, wheel, (s, c), 0.0)
        return
    allowance = COMPLIANCE * samples.radius
    largest_gap = contacts.gap[wheel] + CIRCLE_GAP * samples.radius
    total, sine_sum, cosine_sum, across_sum = 0.0, 0.0, 0.0, 0.0
    turn = contacts.sine[wheel], contacts.cosine[wheel]
    largest = 0.0
    for m in range(samples.circles):
        across = samples.laterals[m]
        gap, (s, c), _ = search_circle(model, work, (wheel, across), turn, largest_gap)
        weight = min(1.0 - (gap - contacts.gap[wheel]) / allowance, 1.0)
        if weight > 0.0:
            largest = max(largest, weight)
            total += weight
            sine_sum += weight * s
            cosine_sum += weight * c
            across_sum += weight * across
    if contacts.inside[wheel]:
        weight = 1.0 - largest
        total += weight
        sine_sum += weight * turn[0]
        cosine_sum += weight * turn[1]
        across_sum += weight * contacts.across[wheel]
    if total > 0.0:
        length = np.sqrt(sine_sum * sine_sum + cosine_sum * cosine_sum)
        turn = sine_sum / length, cosine_sum / length
        write_point(samples.radius, work, wheel, turn, across_sum / total)


@kernel
def write_normal(work, wheel, turn, slope):
    """Write the contact normal: the wheel's radius, tilted by the terrain's slope along the axle.

    It is scaled to z = 1, map frame. `turn` is (sine, cosine) of the contact angle, `slope` that
    of the ground along x and y. The component of the terrain's normal along the circle is left
    out: it is zero where wheel and ground are tangent, and on an edge the wheel's radius is the
    normal.
    """
    placement, normal = work.placement, work.contacts.normal
    axis, forward, up = placement.axis[wheel], placement.forward[wheel], placement.up[wheel]
    s, c = turn
    slope_x, slope_y = slope
    radial_x = -s * forward[0] + c * up[0]
    radial_y = -s * forward[1] + c * up[1]
    radial_z = c * up[2]
    along_radius = radial_z - slope_x * radial_x - slope_y * radial_y
    along_axis = axis[2] - slope_x * axis[0] - slope_y * axis[1]
    z = max(along_radius * radial_z + along_axis * axis[2], LEAST_RISE * along_radius)
    normal[wheel, 0] = (along_radius * radial_x + along_axis * axis[0]) / z
    normal[wheel, 1] = (along_radius * radial_y + along_axis * axis[1]) / z
    normal[wheel, 2] = 1.0
