# SPDX-License-Identifier: Apache-2.0
"""Feeds recorded messages to the service behind a traverse server, and collects its answers."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from msg_adapters.stamps import NANOSECONDS, stamp_to_ns
from rover_physics.errors import RoverError
from rover_physics.names import SIDES
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.terrain.grid import Terrain
from rover_planner.angles import wrap
from rover_planner.maps.known_map import stamp_text
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.judgement import IdentityReport, PathJudgement, refusal
from rover_planner.planning.answering.questions import PathQuestion, Register
from rover_planner.planning.answering.snapshot import GivenPath, Snapshot
from rover_planner.ros.bags.bag_files import IMU, JOINTS, MAP, ODOMETRY, PATH, TF_STATIC, Recorded
from rover_planner.ros.frames import Frames
from rover_planner.ros.server_inputs import ServerInputs

DRIVEN, CHECKED, PLANNED = "driven", "check_path", "can_traverse"
"""Kinds of questions: the drive that was recorded, a path that was recorded, a goal."""
MAX_NOTES = 5
"""Number of refused messages with a note of their own."""
STEP = 0.05
"""Distance between recorded poses [m]; what lies between counts as noise of odometry."""
TURN = 0.05
"""Turn between recorded poses [rad]."""
ANGLES = tuple(f"{part}_{side}" for part in ("rocker", "bogie") for side in SIDES)
"""Suspension joints in the order of a row of angles."""


@dataclass(frozen=True)
class Measured:
    """Measurements at the waypoints of a prediction."""

    stamp: NDArray[np.int64]
    """(n,) time of recording [ns]."""
    rocker_angle: NDArray[np.float64]
    """(n, 2) right, left [rad]; NaN where it was not measured."""
    bogie_angle: NDArray[np.float64]
    """(n, 2) right, left [rad]; NaN where it was not measured."""

    def compare(self, prediction: PathPrediction) -> dict[str, float] | None:
        """Return rms and largest difference to a prediction [rad]; None without measurements."""
        off = np.hstack(
            [
                prediction.rocker_angle - self.rocker_angle,
                prediction.bogie_angle - self.bogie_angle,
            ]
        )
        off = off[np.isfinite(off)]
        if not off.size:
            return None
        return {"rms": float(np.sqrt(np.mean(off**2))), "largest": float(np.abs(off).max())}


@dataclass
class RecordedDrive:
    """The poses of a drive since its begin, STEP or TURN apart."""

    poses: list[NDArray[np.float64]] = field(default_factory=list)
    """(3,) x, y [m], yaw [rad], map frame."""
    stamps: list[int] = field(default_factory=list)
    """Time of each pose [ns]."""
    angles: list[list[float]] = field(default_factory=list)
    """ANGLES measured last before each pose [rad], NaN where none were."""
    length: float = 0.0
    """[m]."""

    def add(self, pose: NDArray[np.float64], stamp: int, joints: Mapping[str, float]) -> None:
        """Add a pose (3,) if the rover has moved."""
        if self.poses:
            step = float(np.hypot(*(pose[:2] - self.poses[-1][:2])))
            turn = wrap(pose[2] - self.poses[-1][2])
            if step < STEP and abs(turn) < TURN:
                return
            self.length += step
        self.poses.append(pose)
        self.stamps.append(stamp)
        self.angles.append([joints.get(name, np.nan) for name in ANGLES])

    def rest(self) -> "RecordedDrive":
        """Return the begin of the next stretch: the last pose of this one."""
        return RecordedDrive(self.poses[-1:], self.stamps[-1:], self.angles[-1:])

    def measured_at(self, poses: NDArray[np.float64]) -> Measured:
        """Return what was measured nearest to each of the waypoints (n, 3) of this drive."""
        driven, places = _progress(np.array(self.poses)), _progress(poses)
        scale = driven[-1] / places[-1] if places[-1] > 0.0 else 1.0
        rows = np.abs(driven[None, :] - scale * places[:, None]).argmin(axis=1)
        angles = np.array(self.angles)[rows]
        return Measured(np.array(self.stamps, np.int64)[rows], angles[:, :2], angles[:, 2:])


def _progress(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far along a drive each pose is: distance [m], a turn of 1 rad as STEP / TURN."""
    steps = np.diff(poses[:, :2], axis=0)
    turns = wrap(np.diff(poses[:, 2]))
    moved = np.hypot(steps[:, 0], steps[:, 1]) + STEP / TURN * np.abs(turns)
    return np.concatenate([[0.0], np.cumsum(moved)])


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
    goal: tuple[float, float, float] | None = None
    """Goal x, y [m], yaw [rad] of a question after each new map; None asks none."""
    start: tuple[float, float, float] | None = None
    """Its start; None takes the last odometry."""
    stretch: float = 5.0
    """Length of the stretches in which the recorded drive is judged [m]."""
    refused: dict[str, int] = field(default_factory=dict)
    """Number of messages that could not be used, by input."""
    notes: list[str] = field(default_factory=list)
    """Why, for the first MAX_NOTES of them."""
    without_start: int = 0
    """Number of new maps without a question for the goal, for lack of a start."""

    def __post_init__(self) -> None:
        values, self._time = self.parameters, 0
        frames = Frames(values, lambda: self._time)
        self.inputs = ServerInputs(values, frames, lambda: self._time / NANOSECONDS)
        """Takes what the messages say."""
        self._service = self.inputs.service
        self._register = Register("replay")
        self._drive, self._begun = RecordedDrive(), self._service.snapshot()

    def take(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        """Take a message; yield the answers to the questions that it causes."""
        self._time = recorded.stamp
        try:
            yield from self._hear(recorded)
        except RoverError as error:
            self.refused[recorded.kind] = self.refused.get(recorded.kind, 0) + 1
            if len(self.notes) < MAX_NOTES:
                self.notes.append(f"{recorded.topic} at {stamp_text(recorded.stamp)}: {error}")

    def finish(self) -> Iterator[ReplayAnswer]:
        """Yield the answer about the rest of the drive."""
        if len(self._drive.poses) > 1:
            yield self._judge_drive()

    def _hear(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        kind, message, inputs = recorded.kind, recorded.message, self.inputs
        if kind == MAP:
            yield from self._take_map(recorded)
        elif kind == ODOMETRY:
            yield from self._take_odometry(recorded)
        elif kind == PATH:
            yield self._ask(CHECKED, recorded.stamp, inputs.read_path(message))
        elif kind == JOINTS:
            inputs.take_joints(message)
        elif kind == IMU:
            inputs.take_imu(message)
        else:
            for transform in message.transforms:
                inputs.frames.take_transform(transform, is_static=kind == TF_STATIC)

    def _take_map(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        header, frames = recorded.message.header, self.inputs.frames
        stamp = stamp_to_ns(header.stamp)
        source = frames.find_source(header.frame_id, stamp, recorded.topic)
        is_new = self.inputs.take_map(recorded.message, source, recorded.topic)
        if not is_new or self.goal is None:
            return
        end = frames.place_level(self.goal)
        start: ArrayLike | None = self._service.fresh_pose(math.inf)
        start = start if self.start is None else frames.place_level(self.start)
        if start is None:
            self.without_start += 1
            return
        yield self._ask(PLANNED, recorded.stamp, PathQuestion(start, end))

    def _take_odometry(self, recorded: Recorded) -> Iterator[ReplayAnswer]:
        self.inputs.take_odometry(recorded.message)
        if self.inputs.may_fill_under_rover():
            self.inputs.fill_under_rover()
        if self._service.known_map is None:
            return  # what is driven before the first map cannot be judged
        if not self._drive.poses or self._begun.known_map is None:
            self._begun = self._service.snapshot(recorded.stamp)
        pose = self._service.fresh_pose()
        assert pose is not None
        self._drive.add(pose, recorded.stamp, self._service.joints)
        if self._drive.length >= self.stretch:
            yield self._judge_drive()
            self._begun = self._service.snapshot(recorded.stamp)

    def _judge_drive(self) -> ReplayAnswer:
        """Judge the drive on the map that was known when it began; begin the next stretch."""
        drive, self._drive = self._drive, self._drive.rest()
        begun = replace(self._begun, measured_pose=None)
        answer = self._ask(DRIVEN, drive.stamps[0], GivenPath(np.array(drive.poses), ""), begun)
        candidate = answer.judgement.candidate
        if candidate is None:
            return answer
        return replace(answer, measured=drive.measured_at(candidate.prediction.poses))

    def _ask(
        self,
        kind: str,
        stamp: int,
        question: PathQuestion | GivenPath,
        snapshot: Snapshot | None = None,
    ) -> ReplayAnswer:
        """Ask a question; an invalid one is refused with its reason."""
        now = self._service.snapshot(stamp) if snapshot is None else snapshot
        try:
            judgement = question.judge(now)
        except RoverError as error:
            judgement = refusal("bad_request", str(error))
        identity = self._register.identify(kind, question, now)
        return ReplayAnswer(kind, stamp, judgement, identity, now.terrain)
