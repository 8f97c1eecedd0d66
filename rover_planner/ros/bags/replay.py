# SPDX-License-Identifier: Apache-2.0
"""Feeds recorded messages to the service behind a traverse server, and collects its answers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msg_adapters.identity import path_hash
from msg_adapters.imu import ImuMounting, imu_to_attitude
from msg_adapters.joints import read_joint_map
from msg_adapters.odometry import odometry_to_pose, odometry_to_tilt
from msg_adapters.paths import path_to_poses
from msg_adapters.sensing import BASE_FRAME
from msg_adapters.stamps import NANOSECONDS, stamp_to_ns
from rover_physics.errors import RoverError
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.maps.known_map import stamp_text
from rover_planner.maps.living_map import MapSnapshot
from rover_planner.maps.map_keeper import MapKeeper
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.judgement import PathJudgement, refusal
from rover_planner.planning.answering.measurements import Measurements
from rover_planner.planning.answering.questions import Register
from rover_planner.planning.answering.service_settings import (
    load_service_settings,
    map_rules,
)
from rover_planner.planning.answering.snapshot import Snapshot
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.navigation.sensor_mounts import sensor_poses
from rover_planner.planning.verdict_report import IdentityReport
from rover_planner.ros.bags.bag_reader import (
    IMU,
    JOINTS,
    MAP,
    ODOMETRY,
    PATH,
    TF,
    TF_STATIC,
    Recorded,
)
from rover_planner.ros.bags.recorded_drive import Measured, RecordedDrive
from rover_planner.ros.frames import Frames
from rover_planner.ros.map_messages import LOOK_PERIOD, read_map

DRIVEN, CHECKED, PLANNED = "driven", "check_path", "can_traverse"
"""Kinds of questions: the drive that was recorded, a path that was recorded, a goal."""
MAX_NOTES = 5
"""Number of refused messages with a note of their own."""


@dataclass(frozen=True)
class Questions:
    """Questions that are asked of a bag."""

    goal: tuple[float, float, float] | None = None
    """Goal x, y [m], yaw [rad] of a question after each new map; None asks none."""
    start: tuple[float, float, float] | None = None
    """Its start; None takes the last odometry."""
    stretch: float = 5.0
    """Length of the stretches in which the recorded drive is judged [m]."""


@dataclass(frozen=True, eq=False)
class ReplayAnswer:
    """An answer to a question of a replay."""

    kind: str
    """DRIVEN, CHECKED or PLANNED."""
    stamp: int
    """Time of the question [ns], as recorded."""
    judgement: PathJudgement
    """The answer."""
    identity: IdentityReport
    """Hashes and stamps of map, path and question."""
    terrain: Terrain | None
    """The map it is about; None if there was none yet."""
    measured: Measured | None = None
    """Measurements at its waypoints; for DRIVEN."""


@dataclass
class Replay:
    """A service, fed with recorded messages."""

    parameters: TraverseServerParameters
    """Parameters as of the node traverse_server."""
    questions: Questions
    """The questions."""
    refused: dict[str, int] = field(default_factory=dict)
    """Number of messages that could not be used, by input."""
    notes: list[str] = field(default_factory=list)
    """Why, for the first MAX_NOTES of them."""
    without_start: int = 0
    """Number of new maps without a question for the goal, for lack of a start."""

    def __post_init__(self) -> None:
        self._service = TraverseService(load_service_settings(self.parameters))
        values = self.parameters
        self._keeper = MapKeeper(self._service.settings.rover, map_rules(values))
        if values.terrain_file:
            terrain = load_terrain(values.terrain_file, values.max_map_cells)
            self._keep(self._keeper.load(terrain, 0.0, None), values.terrain_file, None)
        self._register = Register("replay")
        self._drive, self._begun = RecordedDrive(), self._service.snapshot()
        self._pose: NDArray[np.float64] | None = None
        self._measured = Measurements()  # by the times of the recording
        self._looked = -float("inf")
        self._time = 0
        self.frames = Frames(values, lambda: self._time, sensor_poses(values))
        """Places of frames and sensors on the map."""
        self.joint_names = read_joint_map(values.joint_map, self._service.all_joint_names)
        """Names of the joints in messages."""
        self._imu = ImuMounting(values.imu_frame or BASE_FRAME, values.imu_mounting)
        self._take: dict[str, Callable[[Recorded], Iterator[ReplayAnswer]]] = {
            MAP: self._take_map,
            JOINTS: self._take_joints,
            ODOMETRY: self._take_odometry,
            IMU: self._take_imu,
            TF: self._take_transforms,
            TF_STATIC: self._take_transforms,
            PATH: self._take_path,
        }

    def take(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        """Take a message; yield the answers to the questions that it causes."""
        self._time = recorded.stamp
        try:
            yield from self._take[recorded.kind](recorded)
        except RoverError as error:
            self.refused[recorded.kind] = self.refused.get(recorded.kind, 0) + 1
            if len(self.notes) < MAX_NOTES:
                self.notes.append(f"{recorded.topic} at {stamp_text(recorded.stamp)}: {error}")

    def finish(self) -> Iterator[ReplayAnswer]:
        """Yield the answer about the rest of the drive."""
        if len(self._drive.poses) > 1:
            yield self._judge_drive()

    def _take_map(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        header = recorded.message.header
        stamp = stamp_to_ns(header.stamp)
        source = self.frames.find_source(header.frame_id, stamp, recorded.topic)
        terrain = read_map(recorded.message, self.parameters, source, self._keeper)
        since = (recorded.stamp if stamp is None else stamp) / NANOSECONDS
        standing = self._measured.standing(recorded.stamp / NANOSECONDS)
        kept = self._keeper.take(terrain, recorded.topic, since, standing)
        is_new = self._keep(kept, recorded.topic, stamp)
        goal = self.questions.goal
        if not is_new or goal is None:
            return
        given, end = self.questions.start, self.frames.place_level(goal)
        start: ArrayLike | None = self._pose if given is None else self.frames.place_level(given)
        if start is None:
            self.without_start += 1
            return
        yield self._ask(PLANNED, recorded.stamp, lambda now: now.answer(start, end))

    def _keep(self, snapshot: MapSnapshot, source: str, stamp: int | None) -> bool:
        """Keep a map in the service; return whether its content is new."""
        frame = self.parameters.map_frame
        return self._service.take_terrain(snapshot.terrain, source, stamp, snapshot.sources, frame)

    def _take_joints(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        positions = self.joint_names.positions(recorded.message, self._service.joint_names)
        self._service.take_joints(positions)
        self._measured.take_joints(positions, recorded.stamp / NANOSECONDS)
        yield from ()

    def _take_transforms(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        for transform in recorded.message.transforms:
            self.frames.take_transform(transform, is_static=recorded.kind == TF_STATIC)
        yield from ()

    def _take_imu(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        if self.parameters.imu_attitude:
            attitude = imu_to_attitude(recorded.message, self._imu)
            now = recorded.stamp / NANOSECONDS
            self._measured.take_tilt(attitude.roll, attitude.pitch, now)
        yield from ()

    def _take_odometry(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        here = self.frames.localise_odometry(recorded.message)
        pose, _ = odometry_to_pose(here, self.parameters.map_frame)
        body = float(pose[2]), *odometry_to_tilt(here)
        self.frames.take_odometry(here)
        self._pose, now = pose[[0, 1, 3]], recorded.stamp / NANOSECONDS
        self._service.take_pose(self._pose)
        self._measured.take_pose(self._pose, body, now)
        self._look_under_rover(now)
        if self._service.known_map is None:
            return  # what is driven before the first map cannot be judged
        if not self._drive.poses or self._begun.known_map is None:
            self._begun = self._service.snapshot(recorded.stamp)
        self._drive.add(self._pose, recorded.stamp, self._service.joints)
        if self._drive.length >= self.questions.stretch:
            yield self._judge_drive()
            self._begun = self._service.snapshot(recorded.stamp)

    def _look_under_rover(self, now: float) -> None:
        """Fill unknown ground under the rover, at most every LOOK_PERIOD."""
        standing = self._measured.standing(now)
        is_due = self.parameters.fill_under_rover and now - self._looked >= LOOK_PERIOD
        if standing is None or not is_due or self._service.known_map is None:
            return
        self._looked = now
        filled = self._keeper.fill(standing, now)
        if filled is not None:
            self._service.amend_map(filled.terrain, filled.sources)

    def _take_path(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        there = self.frames.localise_path(recorded.message)
        poses = path_to_poses(there, self.parameters.map_frame)
        about = path_hash(recorded.message), stamp_text(stamp_to_ns(recorded.message.header.stamp))
        self._service.take_path(poses, *about)
        yield self._ask(CHECKED, recorded.stamp, Snapshot.check_path)

    def _judge_drive(self) -> ReplayAnswer:
        """Judge the drive on the map that was known when it began; begin the next stretch."""
        drive, self._drive = self._drive, self._drive.rest()
        self._service.take_path(np.array(drive.poses))
        path = self._service.given_path
        begun = replace(self._begun, path=path, measured_pose=None)
        answer = self._ask(DRIVEN, drive.stamps[0], Snapshot.check_path, begun)
        candidate = answer.judgement.candidate
        if candidate is None:
            return answer
        return replace(answer, measured=drive.measured_at(candidate.prediction.poses))

    def _ask(
        self,
        kind: str,
        stamp: int,
        ask: Callable[[Snapshot], PathJudgement],
        snapshot: Snapshot | None = None,
    ) -> ReplayAnswer:
        """Ask a question; an invalid one is refused with its reason."""
        now = self._service.snapshot(stamp) if snapshot is None else snapshot
        number = self._register.next_number()
        try:
            judgement = ask(now).complete()
        except RoverError as error:
            judgement = refusal("bad_request", str(error))
        identity = self._register.identify(number, kind, "", now)
        identity = replace(identity, path_hash=now.path.hash, path_stamp=now.path.stamp)
        return ReplayAnswer(kind, stamp, judgement, identity, now.terrain)
