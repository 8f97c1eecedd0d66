# SPDX-License-Identifier: Apache-2.0
"""Search of a wheel's rims, beginning where edges of cells cross them; lengths are in cells."""

import numpy as np
from numba import int64

from rover_physics.contact.circle_search import search_circle
from rover_physics.contact.contact_record import CROSSINGS, NOTICED
from rover_physics.contact.intrusion import note_peak
from rover_physics.contact.tracking import keep_contact, take_circle
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import look_up_cell

RIM_BEND = 0.14
"""The same for a rim that crosses a cell in parallel to a side; aslant, it is up to twice that."""
RIM_STEPS = 2
"""Steps for the place where an edge crosses a rim."""
BESIDE_SHARE = 0.8
"""Share of the rise of the wheel: where the gap grows less, the ground is not a plane, and the rim
may touch elsewhere."""
BEYOND = 0.3
"""Distance from a crossing, to both sides, at which a rim is looked at [cells]."""
LEVEL = 1e-9
"""Part of an edge along a direction [cells] below which it is across that direction."""


@kernel
def cross_rim(search, start, along):
    """Note where an edge crosses a rim, if the rim may come near there.

    `start` and `along` are as for `look_along_edge`.
    """
    s, t, base = start
    along_s, along_t, rise = along
    R, inverse = search.radius, 1.0 / search.cosine
    if not abs(along_t) > LEVEL:
        return
    side = 1.0 if t + 0.5 * along_t > search.sine * R * 0.5 else -1.0
    q, share = R, 0.5
    for _ in range(RIM_STEPS):
        at = s + share * along_s
        q = np.sqrt(max(R * R - at * at, 0.0))
        share = (side * search.half_width + search.sine * q - t) / along_t
    if not (share >= 0.0 and share <= 1.0 and q > 0.0):
        return
    at = s + share * along_s
    intrusion = base + share * rise + q * inverse
    side_on = max(search.ahead_x * search.ahead_x, search.ahead_y * search.ahead_y)
    bend = RIM_BEND * R * R / (max(q, 0.2 * R) ** 3 * side_on) * inverse
    if not intrusion + bend > search.best:
        return
    k = search.crossings % CROSSINGS
    search.crossing_s[k], search.crossing_rim[k] = at, int64(side)
    search.crossing[k] = intrusion
    search.crossings += 1


@kernel
def look_along_rims(model, work, wheel):
    """Search the rims at each crossing and on both sides of it, where they may come near."""
    search, gap = work.cells, work.contacts.gap
    for k in range(min(search.crossings, CROSSINGS)):
        if search.crossing[k] > -gap[wheel] / search.cell + NOTICED * search.radius:
            _search_rim(model, work, wheel, search.crossing_rim[k], search.crossing_s[k])
        for beyond in (-BEYOND, BEYOND):
            rim, s = search.crossing_rim[k], search.crossing_s[k] + beyond
            if abs(s) < search.radius and not _is_covered(model.ground, search, rim, s):
                _search_rim(model, work, wheel, rim, s)


@kernel
def _is_covered(ground, search, rim, s):
    """Return whether a rim, -1 right or 1 left, is as far from the ground as over a plane.

    `s` is a place on the rim; the plane is that of the last peak of this rim.
    """
    R, side = search.radius, (rim + 1) // 2
    if search.peak[side] == -np.inf:
        return False
    q = np.sqrt(R * R - s * s)
    t = rim * search.half_width + search.sine * q
    x = search.x + s * search.ahead_x - t * search.ahead_y
    y = search.y + s * search.ahead_y + t * search.ahead_x
    height = (look_up_cell(ground, x, y)[0] - search.z) / search.cell
    intrusion = height + q / search.cosine - search.tangent * t
    # From a contact on a plane the gap grows with the rise of the wheel.
    rise = R - (s * search.peak_s[side] + q * search.peak_q[side]) / R
    return search.peak[side] - intrusion >= BESIDE_SHARE * rise


@kernel
def _search_rim(model, work, wheel, rim, s):
    """Search a rim, -1 right or 1 left, from s [cells], and take what is found if it is nearer."""
    contacts, search, samples = work.contacts, work.cells, model.samples
    across = rim * samples.half_width
    sine = s / search.radius
    turn = sine, np.sqrt(1.0 - sine * sine)
    gap, turn, slope = search_circle(model, work, (wheel, across), turn)
    if not gap < np.inf:
        return
    note_peak(search, (rim + 1) // 2, gap, turn)
    if gap < contacts.gap[wheel] - NOTICED * samples.radius:
        keep_contact(contacts, wheel)
        contacts.across[wheel] = across
        take_circle(contacts, wheel, (gap, turn, slope))
