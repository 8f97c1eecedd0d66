# SPDX-License-Identifier: Apache-2.0
"""Wheels that wedge in slots, which only the whole path shows.

A wheel that falls into a slot as narrow as itself is wedged between its faces. The forces on it
are not determined there: friction at both faces may lock it, whatever the motors do.
"""

from typing import Any

import numpy as np

from rover_physics.prediction.path_kernels import Crossings
from rover_physics.status import Stall

WEDGED = np.radians(140.0)
"""Angle [rad] between contacts in front of and behind a wheel from which it is wedged. The line
between them is then within 20 degrees of both normals, less than the friction angle of any ground
that a rover drives on, so friction at the two faces can hold any force."""


def stop_in_slots(results: Any, crossings: Crossings) -> None:
    """Set the speed share to 0 where a wheel is wedged, of RESULTs (n,) and those between."""
    parts, n = (results, crossings.results), len(results)
    angles = np.concatenate([part["contact_angle"] for part in parts])
    if not (np.fmax.reduce(angles) - np.fmin.reduce(angles) >= WEDGED).any():
        return
    order = crossings.order_among(n)
    speeds = np.concatenate([part["wheel_speed"] for part in parts])
    angles = (angles * np.sign(speeds))[order]
    # The contact jumps from the face behind to the face in front.
    wedged = ((angles[1:] - angles[:-1] >= WEDGED) & (angles[:-1] < 0.0)).any(axis=1)
    rows = order[1 + np.flatnonzero(wedged)]
    for part, own in ((results, rows[rows < n]), (crossings.results, rows[rows >= n] - n)):
        part["speed_share"][own], part["stalls"][own] = 0.0, Stall.WEDGED
