# SPDX-License-Identifier: Apache-2.0
"""Bounds on the wheel contacts on ground whose heights are known within bounds.

A point of the rim can touch only if its gap, minus the error of the height difference, is smaller
than all gaps between it and the nearest point. Errors of different cells are taken as independent;
for correlated errors, as of neighbours, the error of a difference is smaller than this. The bound
also includes that a wheel moves forward or back as other wheels rise or fall, which changes gaps
on a slope.
"""

import numpy as np

from rover_physics.contact.contact_record import MAX_ANGLES, MAX_CIRCLES
from rover_physics.contact.rim_scan import find_gap
from rover_physics.contact.tracking import search_circle
from rover_physics.contact.wheel import COMPLIANCE
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import record_type
from rover_physics.terrain.ground import elevation_of, to_cells

RUNGS = 4
"""Number of places between a point and the nearest point with which the point is compared."""
MAX_CONTACT_ANGLE = np.radians(70.0)
"""Contact angle [rad] at which angles are clipped for the effect of forward motion on gaps."""
SQRT2 = np.sqrt(2.0)
"""Factor from the error of one height to that of the difference of two."""
HALVINGS = 5
"""Bisection steps between the last sample that may touch and the first that cannot."""

RIM = record_type(
    ("gap", float, (MAX_CIRCLES, MAX_ANGLES)),  # vertical gap of each sample [m]
    ("lowest", float, (MAX_CIRCLES, MAX_ANGLES)),  # angle of a local minimum [rad], NaN if none
    ("largest_error", float),  # largest error of a height near the wheel [m]
    ("shift", float),  # largest motion of the wheel forward or back [m]
    ("nearest", float, (MAX_CIRCLES,)),  # smallest gap of each circle [m]
    ("nearest_angle", float, (MAX_CIRCLES,)),  # contact angle of that gap [rad]
)
"""Gaps around the rim of one wheel."""

CONTACT_BOUNDS = record_type(
    ("rim", RIM),
    ("angle", float, (6,)),  # nominal contact angle [rad]
    ("angle_low", float, (6,)),  # smallest possible [rad]
    ("angle_high", float, (6,)),  # largest possible [rad]
    ("lateral", float, (6,)),  # nominal place of the contact along the axle [m]
    ("lateral_low", float, (6,)),  # smallest possible [m]
    ("lateral_high", float, (6,)),  # largest possible [m]
)
"""Bounds on the contacts of the six wheels."""


@kernel
def bound_contacts(uncertain, work, nominal):
    """Write the possible contacts of all wheels of the placed rover into `work.contact_bounds`.

    Args:
        uncertain: UNCERTAIN; the elevation of its `error` bounds the error of each height [m].
        work: BOUNDS_WORK; `spread.shift` is the motion of the wheels forward or back.
        nominal: RESULT on the nominal ground.
    """
    placement, contact_bounds = work.rover.placement, work.contact_bounds
    angles, points, shift = nominal.contact_angle, nominal.contact_points, work.spread.shift
    axis, rim = placement.axis, contact_bounds.rim
    for wheel in range(6):
        lateral = 0.0
        for i in range(3):
            lateral += axis[wheel, i] * (points[wheel, i] - placement.centres[wheel, i])
        angle = angles[wheel]
        contact_bounds.angle[wheel] = angle
        contact_bounds.angle_low[wheel] = contact_bounds.angle_high[wheel] = angle
        contact_bounds.lateral[wheel] = lateral
        contact_bounds.lateral_low[wheel] = contact_bounds.lateral_high[wheel] = lateral
        rim.shift = shift[wheel]
        rim.largest_error = _find_largest_error(uncertain, work, wheel)
        if max(rim.largest_error, rim.shift) > 0.0:
            _look_around(uncertain.nominal, work.rover, wheel, angle, rim)
            _widen(uncertain, work, wheel)


@kernel
def _find_largest_error(uncertain, work, wheel):
    """Return the largest error [m] of a height near a wheel."""
    ground, samples = uncertain.nominal.ground, uncertain.nominal.samples
    error, centres = uncertain.error, work.rover.placement.centres
    extent = samples.extent * ground.inverse_resolution
    gx, gy = to_cells(ground, centres[wheel, 0], centres[wheel, 1])
    largest = 0.0
    for i in range(max(int(gy - extent), 0), min(int(gy + extent) + 2, error.rows)):
        for j in range(max(int(gx - extent), 0), min(int(gx + extent) + 2, error.columns)):
            wrong = elevation_of(error, i, j)
            if wrong > largest:
                largest = wrong
    return largest


@kernel
def _look_around(model, rover, wheel, angle, rim):
    """Write the gaps of all samples of a wheel, and the nearest point of each circle."""
    samples = model.samples
    s, c = np.sin(angle), np.cos(angle)
    for m in range(samples.circles):
        circle = wheel, samples.laterals[m]
        gap, _ = find_gap(model, rover, circle, (s, c))
        rim.nearest[m], rim.nearest_angle[m] = np.inf, angle
        if gap == gap:
            rim.nearest[m] = gap
        for k in range(samples.rows):
            turn = samples.sines[k], samples.cosines[k]
            rim.gap[m, k] = find_gap(model, rover, circle, turn)[0]
        _find_lowest(model, rover, wheel, m, rim)


@kernel
def _find_lowest(model, rover, wheel, m, rim):
    """Write the local minima of the gap of circle m, searched from each local minimum of samples.

    Next to a face or on an edge the gap changes much between two samples.
    """
    samples = model.samples
    for k in range(samples.rows):
        gap = rim.gap[m, k]
        rim.lowest[m, k] = np.nan
        before = rim.gap[m, max(k - 1, 0)]
        after = rim.gap[m, min(k + 1, samples.rows - 1)]
        if gap != gap or gap > before or gap > after:
            continue
        circle, turn = (wheel, samples.laterals[m]), (samples.sines[k], samples.cosines[k])
        gap, turn, _ = search_circle(model, rover, circle, turn, np.inf)
        angle = np.arctan2(turn[0], turn[1])
        rim.lowest[m, k] = angle
        if gap < rim.nearest[m]:
            rim.nearest[m], rim.nearest_angle[m] = gap, angle


@kernel
def _error_between(error, a, b):
    """Return a bound on the error [m] of the height difference of two places (x, y) [cells].

    It is exact for independent errors of the cells, and too large for correlated ones.
    """
    total = 0.0
    for place in range(2):
        gx, gy = a if place == 0 else b
        other_x, other_y = b if place == 0 else a
        i = min(int(gy), error.rows - 2)
        j = min(int(gx), error.columns - 2)
        for row in range(i, i + 2):
            for column in range(j, j + 2):
                here = _weight(gx, gy, row, column)
                there = _weight(other_x, other_y, row, column)
                if place == 0 or there == 0.0:
                    change = (here - there) * elevation_of(error, row, column)
                    total += change * change
    return np.sqrt(total)


@kernel
def _weight(gx, gy, row, column):
    """Return the weight of a cell in the bilinear height at a place."""
    return max(0.0, 1.0 - abs(gx - column)) * max(0.0, 1.0 - abs(gy - row))


@kernel
def _widen(uncertain, work, wheel):
    """Widen the contact of a wheel to all points of its rim that may touch."""
    samples, contact_bounds = uncertain.nominal.samples, work.contact_bounds
    rim = contact_bounds.rim
    best = 0
    for m in range(samples.circles):
        if rim.nearest[m] < rim.nearest[best]:
            best = m
    give = COMPLIANCE * samples.radius
    first, last, largest = contact_bounds.lateral[wheel], contact_bounds.lateral[wheel], 0.0
    for m in range(samples.circles):
        error = _error_to_circle(uncertain, work, wheel, m, best)
        largest = max(largest, error)
        if rim.nearest[m] - rim.nearest[best] <= error + give:
            first, last = min(first, samples.laterals[m]), max(last, samples.laterals[m])
            _widen_angles(uncertain, work, wheel, m)
    # Circles whose gaps differ by less than `give` share the load: small errors shift it slightly.
    share = min(1.0, largest / give)
    middle = contact_bounds.lateral[wheel]
    contact_bounds.lateral_low[wheel] = middle + share * (first - middle)
    contact_bounds.lateral_high[wheel] = middle + share * (last - middle)


@kernel
def _error_to_circle(uncertain, work, wheel, m, best):
    """Return a bound on the error [m] between the gaps of the nearest points of two circles."""
    model, rover, rim = uncertain.nominal, work.rover, work.contact_bounds.rim
    here, there = rim.nearest_angle[m], rim.nearest_angle[best]
    one, other = (wheel, model.samples.laterals[m]), (wheel, model.samples.laterals[best])
    _, a = find_gap(model, rover, one, (np.sin(here), np.cos(here)))
    _, b = find_gap(model, rover, other, (np.sin(there), np.cos(there)))
    return np.hypot(_error_between(uncertain.error, a, b), _shift_between(rim, here, there))


@kernel
def _shift_between(rim, angle, other):
    """Return the change of the gap difference of two angles [m] as the wheel moves forward."""
    angle = min(max(angle, -MAX_CONTACT_ANGLE), MAX_CONTACT_ANGLE)
    other = min(max(other, -MAX_CONTACT_ANGLE), MAX_CONTACT_ANGLE)
    return rim.shift * abs(np.tan(angle) - np.tan(other))


@kernel
def _widen_angles(uncertain, work, wheel, m):
    """Widen the angles of a wheel to those at which circle m may touch."""
    contact_bounds, circle = work.contact_bounds, (wheel, uncertain.nominal.samples.laterals[m])
    nearest = contact_bounds.rim.nearest_angle[m]
    contact_bounds.angle_low[wheel] = min(contact_bounds.angle_low[wheel], nearest)
    contact_bounds.angle_high[wheel] = max(contact_bounds.angle_high[wheel], nearest)
    for side in range(2):
        inside, outside = _find_farthest(uncertain, work, wheel, m, side)
        if contact_bounds.angle_low[wheel] <= outside <= contact_bounds.angle_high[wheel]:
            continue
        for _ in range(HALVINGS):
            middle = 0.5 * (inside + outside)
            if _may_touch(uncertain, work, circle, middle, nearest):
                inside = middle
            else:
                outside = middle
        contact_bounds.angle_low[wheel] = min(contact_bounds.angle_low[wheel], outside)
        contact_bounds.angle_high[wheel] = max(contact_bounds.angle_high[wheel], outside)


@kernel
def _find_farthest(uncertain, work, wheel, m, side):
    """Return the farthest angle [rad] at which circle m may touch, and the next one outwards.

    The search goes over the samples behind the nearest point (side 0) or ahead of it (1). A sample
    counts with the local minimum near it.
    """
    samples, rim = uncertain.nominal.samples, work.contact_bounds.rim
    nearest, circle = rim.nearest_angle[m], (wheel, samples.laterals[m])
    away = -1.0 if side == 0 else 1.0
    spacing = np.pi / (samples.rows - 1)
    outside = nearest
    for step in range(samples.rows):
        k = step if side == 0 else samples.rows - 1 - step
        angle = np.pi * (k / (samples.rows - 1) - 0.5)
        if away * (angle - nearest) <= 0.0:
            break
        outside = angle
        lowest = rim.lowest[m, k]
        doubt = np.hypot(SQRT2 * rim.largest_error, _shift_between(rim, angle, nearest))
        if lowest != lowest and rim.gap[m, k] - rim.nearest[m] > doubt:
            continue
        if lowest == lowest and _may_touch(uncertain, work, circle, lowest, nearest):
            return lowest, _clip_angle(max(away * angle, away * lowest + spacing) * away)
        if _may_touch(uncertain, work, circle, angle, nearest):
            return angle, _clip_angle(angle + away * spacing)
    return nearest, outside


@kernel
def _clip_angle(angle):
    return min(max(angle, -0.5 * np.pi), 0.5 * np.pi)


@kernel
def _may_touch(uncertain, work, circle, angle, nearest):
    """Return whether a circle may touch at `angle` [rad] rather than between it and `nearest`.

    `circle` is (wheel, distance of its circle from its middle plane [m]).
    """
    model, rover, rim = uncertain.nominal, work.rover, work.contact_bounds.rim
    gap, a = find_gap(model, rover, circle, (np.sin(angle), np.cos(angle)))
    if gap != gap:
        return False
    for rung in range(RUNGS):
        other = angle + (nearest - angle) * ((rung + 1.0) / RUNGS) ** 2
        lower, b = find_gap(model, rover, circle, (np.sin(other), np.cos(other)))
        if not gap - lower > 0.0:
            continue
        doubt = np.hypot(_error_between(uncertain.error, a, b), _shift_between(rim, angle, other))
        if gap - lower > doubt:
            return False
    return True
