# SPDX-License-Identifier: Apache-2.0
"""Intrusion of the ground into a wheel: begin of a search, and its elements.

Lengths are in cells here. A point of the ground is at s along the wheel's heading and t to the
left of its centre. The lower side of the cylinder is the surface tan(camber) t - sqrt(R^2 - s^2) /
cos(camber) above the centre. Its distance below the ground is the intrusion.
"""

import numpy as np

from rover_physics.contact.contact_record import NOTICED
from rover_physics.numerics.kernels import kernel
from rover_physics.terrain.ground import to_cells

ROUNDING = 1e-9
"""Bound of rounding errors of places and intrusions [cells]."""


@kernel
def begin_search(model, work, wheel):
    """Write what the search needs of the wheel's place into `work.cells`."""
    ground, samples, placement = model.ground, model.samples, work.placement
    search, centres = work.cells, placement.centres
    scale = ground.inverse_resolution
    search.cell = 1.0 / scale
    search.radius = samples.radius * scale
    search.x, search.y = to_cells(ground, centres[wheel, 0], centres[wheel, 1])
    search.z = centres[wheel, 2]
    search.ahead_x, search.ahead_y = placement.forward[wheel, 0], placement.forward[wheel, 1]
    search.cosine, search.sine = placement.up[wheel, 2], placement.axis[wheel, 2]
    search.tangent = search.sine / search.cosine
    search.half_width = samples.half_width * scale * search.cosine
    lean = search.sine * search.radius
    search.right = min(lean, 0.0) - search.half_width
    search.left = max(lean, 0.0) + search.half_width
    search.found = search.rim = 0
    search.curl = 0.5 / (search.radius * search.cosine)
    search.best = -work.contacts.gap[wheel] * scale + NOTICED * search.radius
    search.best_on_rim = search.best


@kernel
def is_below(search, s, t):
    """Return whether the point (s, t) is below the wheel; |s| must be below R."""
    lean = search.sine * np.sqrt(search.radius * search.radius - s * s)
    return abs(t - lean) <= search.half_width


@kernel
def is_beside(search, low, high):
    """Return whether all that is at places `low` <= t <= `high` is beside the wheel for sure."""
    return low > search.left + ROUNDING or high < search.right - ROUNDING


@kernel
def take_point(search, s, t, base):
    """Keep a point between the rims if it is the best of them so far.

    `base` is its intrusion without the wheel's dome.
    """
    dome = np.sqrt(max(search.radius * search.radius - s * s, 0.0)) / search.cosine
    if base + dome > search.best:
        search.best, search.best_s, search.best_t, search.found = base + dome, s, t, 1
        if search.best > search.best_on_rim:
            search.best_on_rim, search.rim = search.best, 0


@kernel
def take_rim_point(search, rim, s, intrusion):
    """Keep a point of a rim, -1 right or 1 left, if it is the best of all so far."""
    if intrusion > search.best_on_rim + ROUNDING:
        search.best_on_rim, search.rim_s, search.rim = intrusion, s, rim
