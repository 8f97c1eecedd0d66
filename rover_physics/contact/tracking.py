# SPDX-License-Identifier: Apache-2.0
"""Contacts that are followed while the rover moves: on a circle of the wheel, or on the ground.

On a rim the nearest point moves with the wheel, so its circle is searched again. Between the rims
a peak or ridge of the ground touches: its point is fixed to the ground. The point slides along a
ridge when the wheel moves, but the gap depends on that in second order only.
"""

import numpy as np

from rover_physics.contact.circle_search import search_circle
from rover_physics.contact.contact_record import KEPT
from rover_physics.numerics.kernels import kernel


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
