# SPDX-License-Identifier: Apache-2.0
"""The ground under a standing rover: six contacts from measured angles, and the surface between.

A front camera never sees where the rover stands, but the rover does: where the attitude, the
suspension and the place of the body are measured, so are the six points on which its wheels stand.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.records import new_record
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place
from rover_physics.rover.model import Rover
from rover_planner.maps.cells import CellGrid
from rover_planner.maps.layers import Patch

CONTACT_LENGTH = 0.25
"""Distance along a wheel's plane from its contact up to which the ground is measured [radii]."""
EDGE_CELLS = 1.5
"""Width beyond the wheels' outline that interpolation between cells needs [cells]."""
SAME_PLACE = 2e-3
"""Change of each part of pose and suspension up to which a rover stands as before [m, rad]."""


@dataclass(frozen=True, eq=False)
class Standing:
    """Measured pose and suspension of a rover that stands or creeps."""

    pose: Floats
    """(6,) x, y, z [m], roll, pitch, yaw [rad] of the body, map frame."""
    suspension: Floats
    """(4,) angles of SUSPENSION_JOINTS [rad]."""

    def is_like(self, other: "Standing") -> bool:
        """Return whether the rover has hardly moved: by less than SAME_PLACE in m and rad."""
        mine, others = (np.concatenate([one.pose, one.suspension]) for one in (self, other))
        return bool((np.abs(mine - others) < SAME_PLACE).all())

    def place(self, rover: Rover) -> Any:
        """Return the PLACEMENT of a rover's links.

        The differential mirrors the rockers; the mean of both measurements is used.
        """
        placement, (right, left, *bogies) = new_record(PLACEMENT), self.suspension
        q = np.array([*self.pose[2:5], 0.5 * (right - left), *bogies])
        place(pack_linkage(rover), self.pose[[0, 1, 5]], q, placement)
        return placement


@dataclass(frozen=True, eq=False)
class GroundBeneath:
    """The ground under a rover, from the contacts of its wheels.

    Between the contacts of a side the surface is linear along the rover, between the sides it is
    linear across. Beyond the wheels it goes on with the mean slope of each side.
    """

    pose: Floats
    """(3,) x, y [m] and yaw [rad] of the body, map frame."""
    contacts: Floats
    """(6, 3) points on which the wheels stand [m], map frame."""
    outline: Floats
    """(2, 2) smallest and largest x, y of the wheels seen from above [m], axes turned by yaw."""
    half_width: float
    """Half of a wheel's width [m]."""
    contact_length: float
    """Distance along the wheel from its contact up to which the ground is measured [m]."""

    def patch(self, grid: CellGrid, margin: float, std: float) -> tuple[Patch, NDArray[np.bool_]]:
        """Return the ground on the cells of a grid, and True for the cells where wheels stand.

        Heights are NaN beyond the outline.

        Args:
            grid: The cells.
            margin: Width around the wheels' outline to which the ground is continued [m].
            std: Standard deviation of the heights [m].
        """
        beyond = margin + EDGE_CELLS * grid.resolution
        low, high = self.outline[0] - beyond, self.outline[1] + beyond
        x, y, yaw = self.pose
        c, s = np.cos(yaw), np.sin(yaw)
        middle = np.array([x, y]) + np.array([[c, -s], [s, c]]) @ (0.5 * (low + high))
        box = grid.box_around(middle, 0.5 * (high - low), yaw)
        along, across = _to_body(self.pose, *grid.centres_of(box))
        inside = (along >= low[0]) & (along <= high[0])
        inside &= (across >= low[1]) & (across <= high[1])
        heights = np.where(inside, self._height(along, across), np.nan)
        is_contact = inside & self._is_contact(along, across)
        layers = {"elevation": heights, "elevation_std": np.where(inside, std, np.nan)}
        return Patch(box, layers), is_contact

    def _height(self, along: Floats, across: Floats) -> Floats:
        sides = []
        for side in (slice(0, 3), slice(3, 6)):
            ahead, aside = _to_body(self.pose, *self.contacts[side, :2].T)
            z = self.contacts[side, 2]
            slope = (z[2] - z[0]) / (ahead[2] - ahead[0])
            beyond = np.minimum(along - ahead[0], 0.0) + np.maximum(along - ahead[2], 0.0)
            sides.append((np.interp(along, ahead, z) + slope * beyond, aside.mean()))
        (right, y_right), (left, y_left) = sides
        heights: Floats = right + (left - right) * (across - y_right) / (y_left - y_right)
        return heights

    def _is_contact(self, along: Floats, across: Floats) -> NDArray[np.bool_]:
        ahead, aside = _to_body(self.pose, *self.contacts[:, :2].T)
        near = np.abs(along[..., None] - ahead) <= self.contact_length
        near &= np.abs(across[..., None] - aside) <= self.half_width
        return np.asarray(near.any(axis=-1))


def find_ground_beneath(rover: Rover, standing: Standing) -> GroundBeneath:
    """Find the ground under a rover from its measured pose and suspension.

    Each wheel is taken to touch ground of the slope of the plane through the wheels' centres; its
    steering angle is neglected.

    Args:
        rover: The rover.
        standing: What was measured.
    """
    placement, pose = standing.place(rover), standing.pose[[0, 1, 5]]
    centres = np.array(placement.centres)
    normal = _normal_of(centres)
    axle = np.array(placement.R)[:, 1]
    down = normal - (normal @ axle) * axle
    contacts = centres - rover.wheel.radius * down / np.linalg.norm(down)
    centres_here = np.stack(_to_body(pose, *centres[:, :2].T))
    half, radius = 0.5 * rover.wheel.width, rover.wheel.radius
    reach = np.array([radius, half])
    outline = np.stack([centres_here.min(axis=1) - reach, centres_here.max(axis=1) + reach])
    return GroundBeneath(pose, contacts, outline, half, CONTACT_LENGTH * radius)


def _to_body(pose: Floats, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return points [m] of the map along and across a body at x, y [m] and yaw [rad]."""
    dx, dy, c, s = x - pose[0], y - pose[1], np.cos(pose[2]), np.sin(pose[2])
    return c * dx + s * dy, c * dy - s * dx


def _normal_of(points: Floats) -> Floats:
    """Return the upward normal (3,) of the plane that fits points (n, 3) best."""
    middle = points.mean(axis=0)
    slopes = np.linalg.lstsq(points[:, :2] - middle[:2], points[:, 2] - middle[2], rcond=None)[0]
    normal = np.array([-slopes[0], -slopes[1], 1.0])
    return normal / np.linalg.norm(normal)
