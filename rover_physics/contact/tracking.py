# SPDX-License-Identifier: Apache-2.0
"""Contacts that are followed while the rover moves: on a circle of the wheel, or on the ground.

On a rim the nearest point moves with the wheel, so its circle is searched again. Between the rims
a peak or ridge of the ground touches: its point is fixed to the ground. The point slides along a
ridge when the wheel moves, but the gap depends on that in second order only.
"""

import numpy as np

from rover_physics.contact.contact_record import KEPT
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import look_up_cell

REFINEMENTS = 9
"""Largest number of trials of a search."""
GAP_PRECISION = 1e-5
"""Largest error of a circle's smallest gap [wheel radii]."""
TURN_TOLERANCE = 3e-3
"""Error of the contact angle [rad] at which a search stops."""


@kernel
def search_circle(model, work, circle, turn, largest):
    """Return the smallest gap of a circle near an angle, and its place.

    On a plane, the circle touches in the direction of the plane's normal. The first two trials
    therefore take the direction of the normal found last. On an edge this would oscillate, so the
    later trials take the intersection of the gap's tangents from both sides. The gap cannot be
    smaller than at this intersection, which gives the error bound for the stop.

    Args:
        model: A record with `ground` and `samples`.
        work: A record with `placement`.
        circle: Index of the wheel, and distance of the circle from its middle plane [m].
        turn: (sine, cosine) of the first angle.
        largest: Gap [m] at that angle from which on nothing more is searched; infinite to search
            in any case.

    Returns:
        Gap [m], infinite over unknown ground; (sine, cosine) of the contact angle; slope of the
        ground there along x and y.
    """
    ground, samples, placement = model.ground, model.samples, work.placement
    wheel, across = circle
    s, c = turn
    axis, centres = placement.axis[wheel], placement.centres
    forward, up = placement.forward[wheel], placement.up[wheel]
    radius, scale = samples.radius, ground.inverse_resolution
    x = (centres[wheel, 0] + across * axis[0] - ground.x0) * scale
    y = (centres[wheel, 1] + across * axis[1] - ground.y0) * scale
    z = centres[wheel, 2] + across * axis[2]
    ahead_x, ahead_y = radius * scale * forward[0], radius * scale * forward[1]
    down_x, down_y, down_z = radius * scale * up[0], radius * scale * up[1], radius * up[2]
    best, best_s, best_c, best_x, best_y = np.inf, s, c, 0.0, 0.0
    back_s, back_c, ahead_s, ahead_c = -1.0, 0.0, 1.0, 0.0
    back_gap, ahead_gap, back_rate, ahead_rate = np.inf, np.inf, 0.0, 0.0
    for trial in range(REFINEMENTS):
        height, slope_x, slope_y = look_up_cell(
            ground, x + s * ahead_x - c * down_x, y + s * ahead_y - c * down_y
        )
        gap = z - c * down_z - height
        rise = slope_x * forward[0] + slope_y * forward[1]
        fall = up[2] - slope_x * up[0] - slope_y * up[1]
        tilt = s * fall - c * rise
        straight = s * rise + c * fall
        converged = not abs(tilt) > TURN_TOLERANCE * straight
        if gap < best:
            best, best_s, best_c, best_x, best_y = gap, s, c, slope_x, slope_y
            if converged:
                length = np.sqrt(rise * rise + fall * fall)
                inverse = 1.0 / length
                best += radius * (straight - length)
                best_s, best_c = rise * inverse, fall * inverse
        if converged or (trial == 0 and not gap < largest):
            break
        if trial == 0:
            turn_s, turn_c = samples.spacing_sine, samples.spacing_cosine
            if c * turn_c + s * turn_s > 0.0:
                back_s, back_c = s * turn_c - c * turn_s, c * turn_c + s * turn_s
            if c * turn_c - s * turn_s > 0.0:
                ahead_s, ahead_c = s * turn_c + c * turn_s, c * turn_c - s * turn_s
        if tilt > 0.0:
            ahead_s, ahead_c, ahead_gap, ahead_rate = s, c, gap, radius * tilt
        else:
            back_s, back_c, back_gap, back_rate = s, c, gap, radius * tilt
        share = 0.5
        if back_gap < np.inf and ahead_gap < np.inf:
            between = ahead_s * back_c - ahead_c * back_s
            share = (ahead_gap - back_gap - ahead_rate * between) / (
                (back_rate - ahead_rate) * between
            )
            if best - (back_gap + back_rate * share * between) < GAP_PRECISION * radius:
                break
        if trial < 2:
            inverse = 1.0 / np.sqrt(rise * rise + fall * fall)
            s, c = rise * inverse, fall * inverse
        if trial > 1 or not (s * back_c > c * back_s and s * ahead_c < c * ahead_s):
            share = min(max(share, 0.05), 0.95)
            s, c = back_s + share * (ahead_s - back_s), back_c + share * (ahead_c - back_c)
            inverse = 1.0 / np.sqrt(s * s + c * c)
            s, c = s * inverse, c * inverse
    return best, (best_s, best_c), (best_x, best_y)


@kernel
def follow_contact(model, work, wheel):
    """Write where the last contact of a wheel is now; the gap is NaN over unknown ground.

    Returns False, and writes nothing, if its point of the ground is no longer below the wheel.
    """
    contacts = work.contacts
    if contacts.inside[wheel]:
        return _write_peak(model, work, wheel, contacts.peak[wheel])
    turn = contacts.sine[wheel], contacts.cosine[wheel]
    circle = wheel, contacts.across[wheel]
    gap, turn, slope = search_circle(model, work, circle, turn, np.inf)
    take_circle(contacts, wheel, (gap if gap < np.inf else np.nan, turn, slope))
    return True


@kernel
def take_circle(contacts, wheel, found):
    """Write what `search_circle` has found into row `wheel` of the contacts."""
    gap, turn, slope = found
    contacts.gap[wheel], contacts.inside[wheel] = gap, 0
    contacts.sine[wheel], contacts.cosine[wheel] = turn
    contacts.slope[wheel, 0], contacts.slope[wheel, 1] = slope


@kernel
def find_gap_above(model, work, wheel, point):
    """Return the gap [m] of a wheel above a point (3,) of the ground, infinite beside the wheel.

    Further: the place of the point along the wheel's heading, its place across the wheel, and the
    distance of the contact from the axle in the wheel's up direction [m].
    """
    placement, radius = work.placement, model.samples.radius
    forward, up, centres = placement.forward[wheel], placement.up[wheel], placement.centres
    dx, dy = point[0] - centres[wheel, 0], point[1] - centres[wheel, 1]
    s, t = dx * forward[0] + dy * forward[1], dy * forward[0] - dx * forward[1]
    q = np.sqrt(max(radius * radius - s * s, 0.0))
    across = (t - placement.axis[wheel, 2] * q) / up[2]
    if not (q > 0.0 and abs(across) <= model.samples.half_width):
        return np.inf, s, across, q
    return centres[wheel, 2] - point[2] + (placement.axis[wheel, 2] * t - q) / up[2], s, across, q


@kernel
def _write_peak(model, work, wheel, point):
    """Take a point (3,) of the ground as the contact of a wheel; False if it is not below it."""
    contacts, radius = work.contacts, model.samples.radius
    gap, s, across, q = find_gap_above(model, work, wheel, point)
    if not gap < np.inf:
        return False
    contacts.gap[wheel], contacts.inside[wheel] = gap, 1
    contacts.sine[wheel], contacts.cosine[wheel] = min(max(s / radius, -1.0), 1.0), q / radius
    contacts.across[wheel] = across
    for k in range(3):
        contacts.peak[wheel, k] = point[k]
    return True


@kernel
def keep_contact(contacts, wheel):
    """Keep the contact of a wheel, to be looked at again after another one was found."""
    row = contacts.kept[wheel] % KEPT
    contacts.kept_across[wheel, row] = contacts.across[wheel]
    contacts.kept_inside[wheel, row] = contacts.inside[wheel]
    contacts.kept_turn[wheel, row, 0] = contacts.sine[wheel]
    contacts.kept_turn[wheel, row, 1] = contacts.cosine[wheel]
    for k in range(3):
        contacts.kept_peak[wheel, row, k] = contacts.peak[wheel, k]
    contacts.kept[wheel] += 1


@kernel
def look_at_kept(model, work, wheel):
    """Take the nearest of the kept contacts if it is nearer than the contact."""
    contacts = work.contacts
    for row in range(min(contacts.kept[wheel], KEPT)):
        if contacts.kept_inside[wheel, row]:
            peak = contacts.kept_peak[wheel, row]
            gap, _, _, _ = find_gap_above(model, work, wheel, peak)
            if gap < contacts.gap[wheel]:
                _write_peak(model, work, wheel, peak)
            continue
        across = contacts.kept_across[wheel, row]
        turn = contacts.kept_turn[wheel, row, 0], contacts.kept_turn[wheel, row, 1]
        gap, turn, slope = search_circle(model, work, (wheel, across), turn, np.inf)
        if gap < np.inf:
            contacts.kept_turn[wheel, row, 0], contacts.kept_turn[wheel, row, 1] = turn
        if gap < contacts.gap[wheel]:
            contacts.across[wheel] = across
            take_circle(contacts, wheel, (gap, turn, slope))
