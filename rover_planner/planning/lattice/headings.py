# SPDX-License-Identifier: Apache-2.0
"""The sixteen headings of the lattice.

Each points from a node to another one at most two cells away, so that straight lines hit nodes
(the set of Nav2's Smac planner).
"""

import numpy as np

from rover_planner.planning.angles import wrap

HEADINGS = 16
"""Number of headings; the first points along x, the others follow to the left."""
_QUARTER = ((1, 0), (2, 1), (1, 1), (1, 2))
STEPS: tuple[tuple[int, int], ...] = (
    *_QUARTER,
    *((-y, x) for x, y in _QUARTER),
    *((-x, -y) for x, y in _QUARTER),
    *((y, -x) for x, y in _QUARTER),
)
"""Step (x, y) [cells] from a node to the next one straight ahead, for each heading."""
YAWS = np.arctan2(*np.array(STEPS, float).T[::-1])
"""(16,) yaw of each heading [rad, in -pi to pi]."""


def opposite(heading: int) -> int:
    """Return the heading that points the other way."""
    return (heading + HEADINGS // 2) % HEADINGS


def nearest_heading(yaw: float) -> int:
    """Return the heading nearest to a yaw [rad]."""
    return int(np.argmin(np.abs(wrap(YAWS - yaw))))
