# SPDX-License-Identifier: Apache-2.0
"""Contact angles from a map: where the wheels of a rover of known pose are nearest to the ground.

Attitude and suspension angles are measured, so the relative places of the wheels are more accurate
than from the map. The height of the body comes from the map, because odometry drifts. A wheel at
the foot of a face touches both ground and face, and has to climb the face. Of several places that
are about equally near, the one farthest ahead in the direction in which the wheel rolls therefore
counts.
"""

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.names import WHEEL_COUNT, WHEELS
from rover_physics.numerics.kernels import kernel
from rover_physics.numerics.records import array_of, new_record, record_type
from rover_physics.rover.linkage import PLACEMENT, pack_linkage, place
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import height_at_cell, is_cell_on_map, pack_ground, to_cells
from rover_physics.traction.balance import MeasuredState
from rover_physics.traction.contact_ekf import ContactEstimate

MAP_SOURCE = "map"
"""Source of an estimate from a map."""
PROFILE_STEPS = 40
"""Number of ground samples from below a wheel's centre to PROFILE_LENGTH ahead; same behind."""
PROFILE_LENGTH = 1.25
"""Distance ahead of and behind a wheel's centre over which the ground is sampled [wheel radii]."""
PROFILES, MIDDLE_PROFILE = 3, 1
"""Number of ground profiles of a wheel, along its right edge, middle and left edge; index of the
middle one."""
NEAREST_TOLERANCE = 0.06
"""Extra distance over that of the nearest place up to which a place counts [wheel radii]."""
MAX_PLACES = 6
"""Largest number of near places per profile."""
ANGLE_DEVIATION = 0.05
"""Standard deviation of an angle if map and pose are exact [rad]."""
CELL_DEVIATION = 0.3
"""Standard deviation of a place within its cell [cells]."""

MAP_SEARCH = record_type(
    ("pose", float, (3,)),  # x, y [m] and yaw [rad] of the body's origin, map frame
    ("q", float, (6,)),  # z [m], roll, pitch, right rocker, right and left bogie [rad]
    ("directions", float, (WHEEL_COUNT,)),  # 1 where a wheel rolls forward, -1 where backward
    ("placement", PLACEMENT),
    ("distance", float, (PROFILES, MAX_PLACES)),  # of near places from the wheel's centre [m]
    ("angle", float, (PROFILES, MAX_PLACES)),  # contact angles of the same [rad]
    ("gaps", float, (WHEEL_COUNT,)),  # between wheel and ground at the given height [m]
    ("angles", float, (WHEEL_COUNT,)),  # contact angles found [rad]
    ("hindmost", float, (WHEEL_COUNT,)),  # of the places that are as near, those farthest behind
)
"""Input, work space and result of a `MapContactFinder`; NaN where the ground is unknown."""


class MapContactFinder:
    """Finds contact angles of `rover` on `terrain`."""

    def __init__(self, rover: Rover, terrain: Terrain):
        """Prepare for a rover and a map; takes several milliseconds."""
        self.rover, self.terrain = rover, terrain
        self._linkages = array_of(pack_linkage(rover))
        self._ground = pack_ground(terrain)
        self._searches = array_of(new_record(MAP_SEARCH))

    def find(
        self,
        state: MeasuredState,
        pose: np.ndarray,
        deviation: float,
        directions: np.ndarray | float = 1.0,
    ) -> ContactEstimate:
        """Return the contact angles, on the map, of the wheels of a measured rover.

        Args:
            state: Attitude, suspension and steering; its contact angles are not used.
            pose: (4,) x, y, z [m] and yaw [rad] of the body's origin in the map frame.
            deviation: Standard deviation of x and y [m].
            directions: (6,) 1 for wheels that roll forward, so that "ahead" is in front, -1 for
                those that roll backward; one number for all.

        Raises:
            ModelError: A wheel is beyond the map, over unknown ground, or not near the ground.
        """
        arrays = self._ground.records, self._linkages, self._searches
        search = self._searches  # its fields are views; attributes of a record are slow
        q, angles = search["q"][0], search["angles"][0]
        search["pose"][0] = pose[0], pose[1], pose[3]
        q[:4] = pose[2], state.roll, state.pitch, state.rocker_angle
        q[4:] = state.bogie_angles
        search["directions"][0] = directions
        search["placement"]["steering"][0] = state.steering
        find_contacts(*arrays)
        known = np.isfinite(angles)
        if not known.all():
            raise ModelError(
                f"{WHEELS[int(np.argmin(known))]} of a rover at {np.round(pose[:2], 2)} m is over "
                "ground that the map does not have"
            )
        error = np.hypot(deviation, CELL_DEVIATION * self.terrain.resolution)
        error /= self.rover.wheel.radius
        covariance = (ANGLE_DEVIATION**2 + error**2) * np.eye(WHEEL_COUNT)
        return ContactEstimate(angles.copy(), covariance, MAP_SOURCE)


@kernel
def find_contacts(grounds, linkages, searches):
    """Find the height above the map, from one that is near it, and write the contact angles.

    NaN are those of wheels over unknown ground, perhaps of these alone.
    """
    ground, linkage, search = grounds[0], linkages[0], searches[0]
    place(linkage, search.pose, search.q, search.placement)
    for wheel in range(WHEEL_COUNT):
        _scan_profile(ground, linkage, search, wheel, MIDDLE_PROFILE)
        search.gaps[wheel] = search.distance[MIDDLE_PROFILE, 0] - linkage.radius
        search.angles[wheel] = search.gaps[wheel]
    gap = median_of_wheels(search.gaps)
    if gap == gap:
        search.q[0] -= gap
        _find_nearest(ground, linkage, search)


@kernel
def median_of_wheels(values):
    """Return the median of six values; NaN if one is."""
    middle = 0.0
    for one in range(WHEEL_COUNT):
        value, smaller = values[one], 0
        if value != value:
            return value
        for other in range(WHEEL_COUNT):
            if values[other] < value or (values[other] == value and other < one):
                smaller += 1
        if smaller == WHEEL_COUNT // 2 - 1 or smaller == WHEEL_COUNT // 2:
            middle += 0.5 * value
    return middle


@kernel
def _find_nearest(ground, linkage, search):
    """Write for each wheel the angles of the places farthest ahead and behind of its nearest."""
    place(linkage, search.pose, search.q, search.placement)
    angles, hindmost = search.angles, search.hindmost
    for wheel in range(WHEEL_COUNT):
        direction = search.directions[wheel]
        nearest = np.inf
        for profile in range(PROFILES):
            _scan_profile(ground, linkage, search, wheel, profile)
            nearest = min(nearest, search.distance[profile, 0])
        limit = nearest + NEAREST_TOLERANCE * linkage.radius
        angles[wheel] = hindmost[wheel] = np.nan
        for profile in range(PROFILES):
            for k in range(MAX_PLACES):
                distance, angle = search.distance[profile, k], search.angle[profile, k]
                if distance > limit:
                    continue
                if not direction * angles[wheel] >= direction * angle:
                    angles[wheel] = angle
                if not direction * hindmost[wheel] <= direction * angle:
                    hindmost[wheel] = angle


@kernel
def _scan_profile(ground, linkage, search, wheel, profile):
    """Scan a profile of the ground below a wheel, in a plane normal to its axle.

    Writes into row `profile` of search.distance [m] and search.angle [rad]: the nearest place
    first, then other local minima of the distance; infinite if there are no more.
    """
    placement, distances, angles = search.placement, search.distance, search.angle
    axis, centres = placement.axis[wheel], placement.centres
    forward, up = placement.forward[wheel], placement.up[wheel]
    offset = 0.5 * (profile - MIDDLE_PROFILE) * linkage.width
    cx = centres[wheel, 0] + offset * axis[0]
    cy = centres[wheel, 1] + offset * axis[1]
    cz = centres[wheel, 2] + offset * axis[2]
    for k in range(MAX_PLACES):
        distances[profile, k] = angles[profile, k] = np.inf
    step = PROFILE_LENGTH * linkage.radius / PROFILE_STEPS
    x0 = z0 = 0.0
    count, approaches, last, last_angle = 0, False, np.inf, 0.0
    for k in range(-PROFILE_STEPS, PROFILE_STEPS + 1):
        x1 = k * step
        gx, gy = to_cells(ground, cx + x1 * forward[0], cy + x1 * forward[1])
        height = np.nan
        if is_cell_on_map(ground, gx, gy):
            height = height_at_cell(ground, gx, gy)
        if height != height:
            distances[profile, 0] = np.nan
            return
        z1 = (height - cz) * up[2]
        if k > -PROFILE_STEPS:
            distance, angle = _find_nearest_on_segment(x0, z0, x1, z1)
            if distance < distances[profile, 0]:
                distances[profile, 0], angles[profile, 0] = distance, angle
            if approaches and distance >= last and count < MAX_PLACES - 1:
                count += 1
                distances[profile, count], angles[profile, count] = last, last_angle
            if distance != last:
                approaches = distance < last
            last, last_angle = distance, angle
        x0, z0 = x1, z1


@kernel
def _find_nearest_on_segment(x0, z0, x1, z1):
    """Return distance [m] and angle [rad] of a segment's nearest point from the wheel's centre."""
    dx, dz = x1 - x0, z1 - z0
    share = min(max(-(x0 * dx + z0 * dz) / (dx * dx + dz * dz), 0.0), 1.0)
    px, pz = x0 + share * dx, z0 + share * dz
    return np.sqrt(px * px + pz * pz), np.arctan2(px, -pz)
