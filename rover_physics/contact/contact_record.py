"""Record of the wheel contacts, and the scopes of the contact search."""

from enum import IntEnum
from typing import Any

import numpy as np

from rover_physics.contact.wheel_samples import MAX_CIRCLES
from rover_physics.numerics.records import new_record, record_type


class SearchScope(IntEnum):
    """Extent of the search of `find_contact` for the point of a wheel nearest to the ground."""

    COARSE = 0
    """Every other sample of the middle circle."""
    QUICK = 1
    """All samples; the nearest is refined."""
    NEAR = 2
    """No samples; the last contact is refined."""
    FULL = 3
    """All samples; each circle that comes near is refined."""
    AGAIN = 4
    """No samples; the circles that FULL found near are refined."""
    EXACT = 5
    """All samples; each one that may be near is refined."""


CIRCLE_REACH = 2e-2
"""Gap above the smallest one [wheel radii] up to which another circle is refined."""
FAR_ROW = -9
"""Row number that marks "no sample noted"; it is far from every real row."""

CONTACTS = record_type(
    ("gap", float, (6,)),  # smallest vertical gap, negative inside the ground [m]
    ("sine", float, (6,)),  # sine of the contact angle
    ("cosine", float, (6,)),  # cosine of the contact angle
    ("point", float, (6, 3)),  # contact point [m], map frame
    ("normal", float, (6, 3)),  # contact normal scaled to z = 1, map frame
    ("held_height", float, (6,)),  # height [m] of the centre of a wheel held on a face, else NaN
    ("held_angle", float, (6,)),  # contact angle [rad] of a wheel held on a face, else NaN
    ("nearest", np.int64, (6,)),  # index of the circle with the smallest gap
    ("circle_gap", float, (6, MAX_CIRCLES)),  # smallest gap of each circle [m]
    ("circle_sine", float, (6, MAX_CIRCLES)),  # sine of the contact angle at that gap
    ("circle_cosine", float, (6, MAX_CIRCLES)),  # cosine of the contact angle at that gap
    ("circle_slope", float, (6, MAX_CIRCLES, 2)),  # slope of the ground there along x and y
    (
        "block_max",
        float,
        (6,),
    ),  # highest ground below the wheel [m], infinite where some is unknown
    ("noted_gap", float, (6,)),  # smallest gap of the last scan [m]
    ("noted_circle", np.int64, (6,)),  # circle of noted_gap
    ("first_gap", float, (6, MAX_CIRCLES)),  # smallest gap of each circle in the last scan [m]
    ("first_row", np.int64, (6, MAX_CIRCLES)),  # sample row of first_gap
    ("second_gap", float, (6, MAX_CIRCLES)),  # smallest gap away from first_row [m]
    ("second_row", np.int64, (6, MAX_CIRCLES)),  # sample row of second_gap
)
"""Contacts of the six wheels, and notes of the search; written by `find_contact`."""


def new_contacts() -> Any:
    """Return an empty CONTACTS, no wheel held."""
    return new_record(CONTACTS, held_height=np.nan, held_angle=np.nan)
