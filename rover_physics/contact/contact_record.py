# SPDX-License-Identifier: Apache-2.0
"""Records of the wheel contacts and of the samples of a wheel, and the scopes of the search."""

from enum import IntEnum
from typing import Any

import numpy as np

from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import new_record, record_type
from rover_physics.rover.model import Rover


class SearchScope(IntEnum):
    """Extent of the search of `find_contact` for the point of a wheel nearest to the ground."""

    COARSE = 0
    """Every other sample of the middle circle."""
    QUICK = 1
    """All samples; the nearest is refined."""
    NEAR = 2
    """No samples; the last contact and the kept ones are refined, and the nearest is taken."""
    FULL = 3
    """All ground below the wheel, starting from the last contact."""
    WHOLE = 4
    """QUICK, then FULL."""


NOTICED = 1e-4
"""Difference of gaps [wheel radii] up to which a contact elsewhere is not taken."""
KEPT = 4
"""Earlier contacts of a wheel that are looked at again."""

MAX_ANGLES, MAX_CIRCLES = 49, 9
"""Largest numbers of angles and circles, which fix the sizes of the records."""
RIMS = 3
"""Scanned circles: both rims and the middle one."""
WHEEL_SAMPLES = record_type(
    ("radius", float),  # wheel radius [m]
    ("extent", float),  # largest horizontal distance of a sample from the wheel's centre [m]
    ("rows", np.int64),  # number k of contact angles
    ("circles", np.int64),  # number m of circles
    ("sines", float, (MAX_ANGLES,)),  # (k,) sines of the contact angles, ascending
    ("cosines", float, (MAX_ANGLES,)),  # (k,) their cosines
    ("spacing_sine", float),  # sine of the angle between neighbouring samples
    ("spacing_cosine", float),  # cosine of the angle between neighbouring samples
    ("half_width", float),  # distance of the outer circles from the middle plane [m]
    ("laterals", float, (MAX_CIRCLES,)),  # (m,) distances from the middle plane [m], ascending
)
"""Samples of a wheel's cylinder: k angles on each of m circles."""

CONTACTS = record_type(
    ("gap", float, (6,)),  # smallest vertical gap, negative inside the ground [m]
    ("sine", float, (6,)),  # sine of the contact angle
    ("cosine", float, (6,)),  # cosine of the contact angle
    ("point", float, (6, 3)),  # contact point [m], map frame
    ("normal", float, (6, 3)),  # contact normal scaled to z = 1, map frame
    ("held_height", float, (6,)),  # height [m] of the centre of a wheel held on a face, else NaN
    ("held_angle", float, (6,)),  # contact angle [rad] of a wheel held on a face, else NaN
    ("across", float, (6,)),  # distance of the contact from the wheel's middle plane [m]
    ("inside", np.int64, (6,)),  # 1 if the contact is a peak of the ground between the rims
    ("slope", float, (6, 2)),  # slope of the ground at the contact along x and y
    ("peak", float, (6, 3)),  # point of the ground that touches [m], if the contact is inside
    ("kept", np.int64, (6,)),  # number of contacts kept since the last QUICK
    ("kept_across", float, (6, KEPT)),  # `across` of the kept contacts; new ones replace old ones
    ("kept_inside", np.int64, (6, KEPT)),  # `inside` of the kept contacts
    ("kept_turn", float, (6, KEPT, 2)),  # their sine and cosine
    ("kept_peak", float, (6, KEPT, 3)),  # their `peak`
)
"""Contacts of the six wheels, and what the search keeps; written by `find_contact`."""

CELL_SEARCH = record_type(
    ("cell", float),  # size of a cell [m]
    ("radius", float),  # radius of the wheel [cells]
    ("half_width", float),  # half its width, as seen from above [cells]
    ("right", float),  # least place across the heading of what is below it [cells]
    ("left", float),  # largest one [cells]
    ("x", float),  # place of its centre [cells]
    ("y", float),
    ("z", float),  # height of its centre [m]
    ("ahead_x", float),  # its heading
    ("ahead_y", float),
    ("sine", float),  # of the camber
    ("cosine", float),
    ("tangent", float),
    ("best", float),  # largest intrusion so far between the rims [cells]
    ("best_s", float),  # its place along the heading [cells]
    ("best_t", float),  # its place to the left [cells]
    ("found", np.int64),  # 1 if the search has found it
    ("best_on_rim", float),  # largest intrusion so far of rims and between them [cells]
    ("rim_s", float),  # its place along the heading, if it is on a rim [cells]
    ("rim", np.int64),  # -1 if it is on the right rim, 1 on the left one, else 0
    ("curl", float),  # half the least curvature of the wheel along its heading [1/cells]
)
"""Work space of `look_everywhere`."""


def sample_wheel(rover: Rover, resolution: float) -> Any:
    """Return WHEEL_SAMPLES about as dense as the cells of a terrain of `resolution` [m].

    There are 21 to 49 angles and 5 to 9 circles.
    """
    wheel = rover.wheel
    half_angles = int(np.clip(np.ceil(0.5 * np.pi * wheel.radius / resolution), 10, 24))
    half_laterals = int(np.clip(np.ceil(0.5 * wheel.width / resolution), 2, 4))
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 2 * half_angles + 1)
    samples = new_record(
        WHEEL_SAMPLES,
        radius=wheel.radius,
        extent=np.hypot(wheel.radius, 0.5 * wheel.width),
        rows=angles.size,
        circles=2 * half_laterals + 1,
        half_width=0.5 * wheel.width,
        spacing_sine=np.sin(angles[1] - angles[0]),
        spacing_cosine=np.cos(angles[1] - angles[0]),
    )
    samples.sines[: angles.size], samples.cosines[: angles.size] = np.sin(angles), np.cos(angles)
    half = samples.half_width
    samples.laterals[: samples.circles] = np.linspace(-half, half, samples.circles)
    return samples


@kernel
def hold_wheels(held, i, contacts):
    """Copy height and contact angle of the held wheels at pose i into the contacts."""
    for wheel in range(6 if held.shape[0] > 0 else 0):
        contacts.held_height[wheel] = held[i, wheel, 0]
        contacts.held_angle[wheel] = held[i, wheel, 1]


@kernel
def point_of_rim(radius, placement, circle, turn):
    """Return a point x, y, z [m] of a wheel's cylinder, map frame.

    `circle` is (wheel, distance from its middle plane [m], positive to the left), `turn` (sine,
    cosine) of the contact angle.
    """
    (wheel, across), (s, c), centres = circle, turn, placement.centres
    axis, forward, up = placement.axis[wheel], placement.forward[wheel], placement.up[wheel]
    return (
        centres[wheel, 0] + across * axis[0] + radius * (s * forward[0] - c * up[0]),
        centres[wheel, 1] + across * axis[1] + radius * (s * forward[1] - c * up[1]),
        centres[wheel, 2] + across * axis[2] - radius * c * up[2],
    )


@kernel
def write_point(radius, work, wheel, turn, across):
    """Write a point of a wheel's cylinder [m], map frame, and its contact angle into the contacts.

    `turn` is (sine, cosine) of the contact angle, `across` the distance from the middle plane
    [m], positive to the left.
    """
    placement, contacts = work.placement, work.contacts
    axis, centres = placement.axis[wheel], placement.centres
    forward, up = placement.forward[wheel], placement.up[wheel]
    s, c = turn
    contacts.sine[wheel], contacts.cosine[wheel] = s, c
    for i in range(3):
        radial = radius * (s * forward[i] - c * up[i])
        contacts.point[wheel, i] = centres[wheel, i] + across * axis[i] + radial
