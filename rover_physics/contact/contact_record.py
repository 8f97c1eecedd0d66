"""The record of where the wheels touch the ground, and how thoroughly that is looked for."""

from enum import IntEnum
from typing import Any

import numpy as np

from rover_physics.contact.wheel_samples import MAX_CIRCLES
from rover_physics.numerics.records import new_record, record_type


class SearchScope(IntEnum):
    """How thoroughly `find_contact` looks for the place of a wheel that is nearest the ground."""

    COARSE = 0
    """Every other sample of the middle circle."""
    QUICK = 1
    """All samples, and closer at the nearest."""
    NEAR = 2
    """Only around the direction found last."""
    FULL = 3
    """All samples, and closer at each other circle that comes near."""
    AGAIN = 4
    """Closer only at the circles that FULL found near."""
    EXACT = 5
    """Closer at each local minimum of each circle."""


CIRCLE_REACH = 2e-2
"""How far above the nearest circle, in wheel radii, another one is looked at more closely."""
FAR_ROW = -9
"""Row of a sample that there is none of."""

CONTACTS = record_type(
    ("gap", float, (6,)),  # smallest vertical gap, negative inside the ground [m]
    ("sine", float, (6,)),  # sine of the contact angle
    ("cosine", float, (6,)),  # cosine of the contact angle
    ("point", float, (6, 3)),  # touching point [m], map frame
    ("normal", float, (6, 3)),  # normal that governs how the gap changes, z = 1, map frame
    ("held_height", float, (6,)),  # height [m] at which a wheel that climbs a face is held, or NaN
    ("held_angle", float, (6,)),  # contact angle with the face of a held wheel [rad]
    ("nearest", np.int64, (6,)),  # index of the circle that touches
    ("circle_gap", float, (6, MAX_CIRCLES)),  # smallest gap on each circle [m]
    ("circle_sine", float, (6, MAX_CIRCLES)),  # sine of the angle where it is
    ("circle_cosine", float, (6, MAX_CIRCLES)),  # cosine of the angle where it is
    ("circle_slope", float, (6, MAX_CIRCLES, 2)),  # slope of the ground there along x and y
    (
        "block_max",
        float,
        (6,),
    ),  # highest ground below the wheel [m], infinite where some is unknown
    ("noted_gap", float, (6,)),  # smallest sampled gap of the last scan [m]
    ("noted_circle", np.int64, (6,)),  # the circle of that
    ("first_gap", float, (6, MAX_CIRCLES)),  # smallest sampled gap of each circle then [m]
    ("first_row", np.int64, (6, MAX_CIRCLES)),  # the row of that
    ("second_gap", float, (6, MAX_CIRCLES)),  # smallest sampled gap away from that [m]
    ("second_row", np.int64, (6, MAX_CIRCLES)),  # the row of that
)
"""Where the six wheels touch; written by `find_touch` and `find_contact`."""


def new_contacts() -> Any:
    """Return an empty TOUCH, no wheel held."""
    return new_record(CONTACTS, held_height=np.nan, held_angle=np.nan)
