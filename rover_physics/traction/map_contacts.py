"""Contact angles from a map: where the wheels of a rover of known pose are nearest to the ground.

Attitude and suspension angles are measured, so the wheels' places relative to one another are
known better than from the map; the height of the body is taken from the map, since odometry
drifts. A wheel at the foot of a face touches ground and face: it is the face that it has to
climb, so of places about equally near the one most ahead counts.
"""

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import WHEELS
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place
from rover_physics.rover.manipulator import body_mass_and_com
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import height_at_cell, is_cell_on_map, pack_ground
from rover_physics.traction.balance import MeasuredState
from rover_physics.traction.contact_ekf import ContactEstimate

STEPS = 14
"""Samples of the ground from under a wheel's centre to REACH ahead, and as many behind."""
REACH = 1.25
"""How far ahead and behind the ground is looked at, in wheel radii."""
NEARLY = 0.06
"""How much farther than the nearest place another may be that still counts, in wheel radii."""
PLACES = 6
"""Places that are remembered of one profile of the ground."""
OWN_ERROR = 0.05
"""Standard deviation of an angle where map and pose are exact [rad]."""


class MapContactFinder:
    """Finds contact angles of one rover on one map."""

    def __init__(self, rover: Rover, terrain: Terrain):
        """Prepare for a rover and a map."""
        self._linkages = array_of(pack_linkage(rover, *body_mass_and_com(rover)))
        self._radius = rover.wheel.radius
        self._ground = pack_ground(terrain)
        self._resolution = terrain.resolution
        self._placements = array_of(new_record(PLACEMENT))
        self._found = np.empty((3, PLACES, 2))

    def find(
        self, state: MeasuredState, pose: np.ndarray, deviation: float, forward: bool = True
    ) -> ContactEstimate:
        """Find the contact angles.

        Args:
            state: Attitude and suspension; its contact angles are not looked at.
            pose: (4,) x, y, z [m] and yaw [rad] of the body's origin in the map frame.
            deviation: Standard deviation of x and y [m].
            forward: Whether the rover drives forwards: ahead is in front.

        Raises:
            ModelError: A wheel is beyond the map, over unknown ground, or not near the ground.
        """
        q = np.array([pose[2], state.roll, state.pitch, state.rocker_angle, *state.bogie_angles])
        angles, gaps, pose = np.zeros(6), np.empty(6), np.asarray(pose, dtype=float)
        _find_angles(
            self._ground.records, self._linkages, self._placements,
            1.0 if forward else -1.0, pose[[0, 1, 3]], q, self._found, gaps, angles,
        )  # fmt: skip
        known = np.isfinite(gaps) & np.isfinite(angles)
        if not known.all():
            raise ModelError(
                f"{WHEELS[int(np.argmin(known))]} of a rover at {np.round(pose[:2], 2)} m is over "
                "ground that the map does not have"
            )
        error = np.hypot(deviation, 0.3 * self._resolution) / self._radius
        return ContactEstimate(angles, (OWN_ERROR**2 + error**2) * np.eye(6), "map")


@kernel
def _find_angles(grounds, linkages, placements, ahead, pose, q, found, gaps, angles):
    """Write gaps [m] at the given height, and angles [rad] at the height that the map tells."""
    ground, linkage, placement = grounds[0], linkages[0], placements[0]
    place(linkage, pose, q, placement)
    _measure_gaps(ground, linkage, placement, found, gaps)
    q[0] -= _median(gaps)
    if np.isfinite(q[0]):
        place(linkage, pose, q, placement)
        _find_nearest(ground, linkage, placement, ahead, found, angles)


@kernel
def _median(values):
    """Return the median of (6,) values, NaN where one is."""
    lower = upper = np.nan
    for i in range(6):
        if values[i] != values[i]:
            return np.nan
        rank = 0
        for j in range(6):
            rank += values[j] < values[i] or (values[j] == values[i] and j < i)
        if rank == 2:
            lower = values[i]
        if rank == 3:
            upper = values[i]
    return 0.5 * (lower + upper)


@kernel
def _measure_gaps(ground, linkage, placement, found, gaps):
    """Write how far the ground is off each wheel's middle circle [m], NaN where unknown."""
    for wheel in range(6):
        _scan_profile(ground, placement, wheel, 0.0, linkage.radius, found, 0)
        gaps[wheel] = found[0, 0, 0] - linkage.radius


@kernel
def _find_nearest(ground, linkage, placement, ahead, found, angles):
    """Write for each wheel the angle most ahead of those where it is about nearest."""
    for wheel in range(6):
        nearest = np.inf
        for across in range(3):
            offset = 0.5 * (across - 1) * linkage.width
            _scan_profile(ground, placement, wheel, offset, linkage.radius, found, across)
            nearest = min(nearest, found[across, 0, 0])
        limit = nearest + NEARLY * linkage.radius
        angles[wheel] = np.nan
        for across in range(3):
            for k in range(PLACES):
                distance, angle = found[across, k, 0], found[across, k, 1]
                if distance <= limit and not ahead * angles[wheel] >= ahead * angle:
                    angles[wheel] = angle


@kernel
def _scan_profile(ground, placement, wheel, offset, radius, found, across):
    """Look along the ground in the plane of a wheel, `offset` [m] from its middle.

    Writes into found[across] (PLACES, 2) distance [m] from the wheel's centre and contact angle
    [rad] of the nearest place first, then of places nearer than their surroundings.
    """
    R, forward, up, centres = placement.R, placement.forward, placement.up, placement.centres
    cx = centres[wheel, 0] + offset * R[0, 1]
    cy = centres[wheel, 1] + offset * R[1, 1]
    cz = centres[wheel, 2] + offset * R[2, 1]
    for k in range(PLACES):
        found[across, k, 0] = found[across, k, 1] = np.inf
    step = REACH * radius / STEPS
    x0 = z0 = 0.0
    count, falling, last, last_angle = 0, False, np.inf, 0.0
    for k in range(-STEPS, STEPS + 1):
        x1 = k * step
        gx = (cx + x1 * forward[0] - ground.x0) * ground.inverse_resolution
        gy = (cy + x1 * forward[1] - ground.y0) * ground.inverse_resolution
        height = np.nan
        if is_cell_on_map(ground, gx, gy):
            height = height_at_cell(ground, gx, gy)
        if height != height:
            found[across, 0, 0] = np.nan
            return
        z1 = (height - cz) * up[2]
        if k > -STEPS:
            dx, dz = x1 - x0, z1 - z0
            share = min(max(-(x0 * dx + z0 * dz) / (dx * dx + dz * dz), 0.0), 1.0)
            px, pz = x0 + share * dx, z0 + share * dz
            distance, angle = np.sqrt(px * px + pz * pz), np.arctan2(px, -pz)
            if distance < found[across, 0, 0]:
                found[across, 0, 0], found[across, 0, 1] = distance, angle
            if falling and distance >= last and count < PLACES - 1:
                count += 1
                found[across, count, 0], found[across, count, 1] = last, last_angle
            if distance != last:
                falling = distance < last
            last, last_angle = distance, angle
        x0, z0 = x1, z1
