# SPDX-License-Identifier: Apache-2.0
"""The traverse server without ROS: keeps map, path and measurements, and answers queries."""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from rover_physics.bounds.path import forget_terrains, prepare_bounds
from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import pack_ground
from rover_planner.maps.ground_beneath import Standing
from rover_planner.maps.known_map import KnownMap
from rover_planner.maps.layers import CellSources
from rover_planner.parameters.traverse_server import OFF
from rover_planner.planning.answering.service_settings import ServiceSettings
from rover_planner.planning.answering.snapshot import GivenPath, Snapshot
from rover_planner.planning.learned_ground import LearnedGround, lay_friction
from rover_planner.planning.marked_places import NONE_MARKED, MarkedPlace, MarkedPlaces
from rover_planner.planning.search.edge_memory import EdgeMemory

MAX_AGE = 1.0
"""Age up to which a measurement counts as one of now [s]."""


class Measured(NamedTuple):
    """What was measured, and when [s]."""

    value: Any
    time: float


class TraverseService:
    """Keeps the last valid map, path and measurements, and answers queries about them.

    Maps may be taken in another thread than the rest, all in the same one.
    """

    def __init__(self, settings: ServiceSettings, clock: Callable[[], float] = time.monotonic):
        """Begin without a map; `clock` returns the time [s] that measurements and maps age by."""
        self._clock = clock
        self.settings = settings
        """The current settings; after a change of `largest_gap` call `refresh_map`."""
        self.known_map: KnownMap | None = None
        """The last valid map; None if there is none."""
        self.given_path = GivenPath()
        """The last path, or the reason why it was refused."""
        self.marked = NONE_MARKED
        """Places that are impassable, for new questions."""
        self._edge_memory = EdgeMemory()
        self._ground: LearnedGround | None = None
        self._laid: tuple[KnownMap, dict[int, float], KnownMap] | None = None
        self._joints: dict[str, Measured] = {}
        self._pose: Measured | None = None
        self._tilt: Measured | None = None

    @property
    def terrain(self) -> Terrain | None:
        """The last valid map, with small gaps interpolated if so set; None if there is none."""
        return None if self.known_map is None else self.known_map.terrain

    @property
    def joints(self) -> dict[str, float]:
        """Measured angles [rad] by name, of any age."""
        return {name: angle.value for name, angle in self._joints.items()}

    def take_joints(self, positions: Mapping[str, float]) -> None:
        """Keep measured joint angles [rad] by name; angles of other joints stay."""
        now = self._clock()
        # A new mapping: another thread may read the last one.
        self._joints = self._joints | {name: Measured(at, now) for name, at in positions.items()}

    def take_pose(self, pose: Floats) -> None:
        """Keep the measured x, y, z [m], roll, pitch, yaw [rad] (6,) of the body, map frame."""
        self._pose = Measured(pose, self._clock())

    def take_tilt(self, roll: float, pitch: float) -> None:
        """Keep roll and pitch [rad] of the body, measured by an IMU."""
        self._tilt = Measured((roll, pitch), self._clock())

    def _is_recent(self, *measured: Measured, max_age: float = MAX_AGE) -> bool:
        """Return whether no measurement is older than `max_age` [s]."""
        return self._clock() - min(one.time for one in measured) <= max_age

    def standing(self) -> Standing | None:
        """Return pose and suspension if all of them are not older than MAX_AGE, else None.

        Roll and pitch are those of the IMU if there ever was one, else those of the pose.
        """
        pose, tilt, joints = self._pose, self._tilt, self._joints
        if pose is None or not joints.keys() >= set(SUSPENSION_JOINTS):
            return None
        angles = [joints[name] for name in SUSPENSION_JOINTS]
        if not self._is_recent(pose, tilt or pose, *angles):
            return None
        measured = np.array(pose.value)
        if tilt is not None:
            measured[3:5] = tilt.value
        return Standing(measured, np.array([angle.value for angle in angles]))

    def fresh_pose(self, max_age: float = MAX_AGE) -> Floats | None:
        """Return the pose (3,) x, y [m], yaw [rad] if it is not older than `max_age` [s]."""
        pose = self._pose
        if pose is None or not self._is_recent(pose, max_age=max_age):
            return None
        return pose.value[[0, 1, 5]]

    def pose_with_suspension(self) -> Floats | None:
        """Return the pose (3,) if it and the suspension's angles are not older than MAX_AGE."""
        angles = [at for name, at in self._joints.items() if name in SUSPENSION_JOINTS]
        return self.fresh_pose() if angles and self._is_recent(*angles) else None

    def take_terrain(
        self,
        terrain: Terrain,
        source: str = "",
        stamp: int | None = None,
        cells: CellSources | None = None,
    ) -> bool:
        """Keep a map until the next one; return whether its content is new.

        Args:
            terrain: The map.
            source: Topic or file it comes from.
            stamp: Stamp of its header [ns, ROS time]; None if it has none.
            cells: Where its cells come from; None if that is `source` for all.
        """
        return self._keep_map(KnownMap(terrain, terrain, source, stamp, self._clock(), cells))

    def amend_map(self, terrain: Terrain, cells: CellSources) -> None:
        """Keep a map with more known cells than the present one, of the same age."""
        known = self.known_map
        if known is not None:
            self._keep_map(replace(known, received=terrain, cells=cells))

    def refresh_map(self) -> None:
        """Interpolate the gaps of the received map again, with the present settings."""
        known = self.known_map
        if known is not None:
            self.known_map = self._fill_gaps(known)

    def prepare(self) -> None:
        """Pack the present map for questions; the watch, which looks at a part, does not wait."""
        terrain = self.terrain
        if terrain is not None:
            pack_ground(terrain)
            prepare_bounds(terrain, self.settings.query.map_sigmas)

    def take_ground(self, ground: LearnedGround) -> None:
        """Keep what was learned of the ground, for new questions."""
        self._ground = ground

    def mark(self, place: MarkedPlace) -> bool:
        """Keep a place as impassable; return whether it is new."""
        is_new = place not in self.marked.places
        if is_new:
            self.marked = MarkedPlaces((*self.marked.places, place))
        return is_new

    def snapshot(self, ros_time: int | None = None) -> Snapshot:
        """Return all that is known now.

        Args:
            ros_time: Present ROS time [ns], for the age of the map; None is the system's time.
        """
        ground = None if self.settings.parameters.learn == OFF else self._ground
        known = Snapshot(
            self.settings.on_ground(ground),
            self.given_path,
            self.joints,
            measured_pose=self.pose_with_suspension(),
            edge_memory=self._edge_memory,
            ground=ground,
            marked=self.marked,
        )
        return self.add_map(known, ros_time)

    def add_map(self, snapshot: Snapshot, ros_time: int | None = None) -> Snapshot:
        """Return a snapshot with the present map; `ros_time` as for `snapshot`."""
        ros_time = time.time_ns() if ros_time is None else ros_time
        known, most = self.known_map, snapshot.settings.parameters.max_map_age
        if known is None:
            return replace(snapshot, known_map=None)
        steady = self._clock()
        classes, laid = self._lay_friction(known, snapshot)
        return replace(
            snapshot,
            known_map=laid,
            class_friction=classes,
            map_age=known.age(ros_time, steady),
            stale_map=known.describe_age(ros_time, steady, most) if most > 0.0 else "",
        )

    def _lay_friction(
        self, known: KnownMap, snapshot: Snapshot
    ) -> tuple[dict[int, float], KnownMap]:
        """Return what new questions assume on each class of a map, and the map with it."""
        ground, told = snapshot.ground, snapshot.settings.told
        if ground is None or told is None or known.terrain.ground_class is None:
            return {}, known
        classes = ground.assume_classes(known.terrain, told)
        last = self._laid  # which another thread may replace meanwhile
        if last is None or last[0].terrain is not known.terrain or last[1] != classes:
            laid = replace(known, terrain=lay_friction(known.terrain, classes))
            pack_ground(laid.terrain)
            last = self._laid = known, classes, laid
        elif last[0] is not known:  # the same map has arrived once more
            last = self._laid = known, classes, replace(known, terrain=last[2].terrain)
        return classes, last[2]

    def _keep_map(self, about: KnownMap) -> bool:
        """Keep a map, of which only the terrain is missing; return whether it is new.

        One that says the same as the last keeps its terrain, on which nothing is judged again.
        `prepare` makes the first question about a new one fast.
        """
        before = self.known_map
        if before is not None and before.fingerprint == about.fingerprint:
            self.known_map = replace(about, received=before.received, terrain=before.terrain)
            return False
        self.known_map = self._fill_gaps(about)
        return True

    def _fill_gaps(self, known: KnownMap) -> KnownMap:
        """Return a map with the gaps of what was received interpolated, if so set."""
        forget_terrains()
        gap = self.settings.largest_gap
        terrain = known.received.fill_gaps(gap) if gap > 0.0 else known.received
        return replace(known, terrain=terrain)
