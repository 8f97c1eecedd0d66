# SPDX-License-Identifier: Apache-2.0
"""Watches a drive: judges the rest of the accepted path again, and says when to stop and why."""

import math
import time
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import TerrainError
from rover_physics.rover.steering_joints import swing_radius
from rover_physics.terrain.grid import Terrain, cut_around
from rover_planner.planning.answering.judgement import PathJudgement, refusal
from rover_planner.planning.answering.server_health import ERROR, OK, WARN, Health
from rover_planner.planning.answering.service_settings import ServiceSettings
from rover_planner.planning.answering.snapshot import Snapshot
from rover_planner.planning.marked_places import MarkedPlaces
from rover_planner.planning.navigation.watched_path import Place, WatchedPath

IDLE, WATCHING, STOPPED, ARRIVED = "idle", "watching", "stopped", "arrived"
"""States of a monitor."""
NO_POSE, NO_JOINTS, OFF_PATH, SUSPENSION = "no_pose", "no_joints", "off_path", "suspension"
"""Codes of a stop besides those of a verdict."""
NEAR = 30.0
"""Length of the part of the path that is judged before the whole rest [wheel radii]: the rover is
told early of what is near."""
AROUND = 3.0
"""Map around that part that is looked at, in distances of the farthest wheel."""
SHARE = 0.25
"""Share of the time that judging may take where the map changes all the time."""
MAX_PAUSE = 0.2
"""Longest pause after a judgement [s]."""
DRIFT_TIME = 1.0
"""Time for which a difference of the suspension must last to be a reason to stop [s]."""


@dataclass(frozen=True, eq=False)
class Sight:
    """Map, settings and pose of the rover at the time of a check."""

    snapshot: Snapshot
    """Settings, map and measured suspension."""
    pose: NDArray[np.float64] | None
    """(3,) x, y [m] and yaw [rad] of the body, measured just now; None if it is not known."""
    time: float
    """Time of the steady clock [s]."""


@dataclass(frozen=True, eq=False)
class Finding:
    """State of the watch, and the judgement on the rest of the path that it follows from."""

    state: str
    """IDLE, WATCHING, STOPPED or ARRIVED."""
    path_hash: str = ""
    """Hash of the watched path."""
    judgement: PathJudgement | None = None
    """Reason to stop, or the last judgement on the rest of the path."""
    place: Place | None = None
    """Place of the rover on the path."""
    judged: int = 0
    """Number of times that the rest of this path was judged."""
    mismatch: dict[str, float] = field(default_factory=dict)
    """Measured minus predicted suspension angle by joint [rad]; empty if it is not known."""

    @property
    def drift(self) -> float:
        """The largest difference of a suspension angle [rad], NaN if it is not known."""
        return max((abs(value) for value in self.mismatch.values()), default=math.nan)


class PathMonitor:
    """Watches the path that was accepted last; after a stop it waits for the next one.

    All methods belong to one thread.
    """

    def __init__(self) -> None:
        self._path: WatchedPath | None = None
        self.finding = Finding(IDLE)
        """The last finding."""
        self._judged_on: tuple[Terrain | None, ServiceSettings, MarkedPlaces] | None = None
        self._pose_time = self._compared_time = self._agreed_time = 0.0
        self._joints_time: float | None = None
        self._pause_end = 0.0

    def take_path(self, path: WatchedPath, sight: Sight) -> bool:
        """Watch a path from now on; return whether it is watched.

        A path that the rover does not stand on answers a question about another place: the path
        that is watched stays.
        """
        settings = sight.snapshot.settings
        if sight.pose is not None:
            place = path.find_place(sight.pose, wheel_radius=settings.rover.wheel.radius)
            if place.offset > settings.monitor_offset:
                return False
        self._path, self._judged_on, self._joints_time = path, None, None
        self._pose_time = self._agreed_time = sight.time
        self.finding = Finding(WATCHING, path.hash)
        return True

    def forget(self) -> None:
        """Watch nothing until the next path."""
        self._path, self.finding = None, Finding(IDLE, mismatch=self.finding.mismatch)

    def stop(self, reason: PathJudgement) -> Finding:
        """Stop the rover for a reason that was found elsewhere."""
        self.finding = replace(self.finding, state=STOPPED, judgement=reason)
        return self.finding

    def look(self, sight: Sight) -> Finding:
        """Compare the suspension, look at the rest of the path, and return what was found.

        Raises:
            PlanningError, RoverError: The rest cannot be judged with these settings.
        """
        self._compare_suspension(sight)
        if self._path is None or self.finding.state != WATCHING:
            return self.finding
        refused = (
            self._find_place(self._path, sight)
            or self._miss_joints(sight)
            or self._refuse_drift(sight)
            or self._judge_rest(self._path, sight)
        )
        if refused is not None:
            return self.stop(refused)
        place = self.finding.place
        if place is not None and self._path.is_end(place.index):
            self.finding = replace(self.finding, state=ARRIVED)
        return self.finding

    def _find_place(self, path: WatchedPath, sight: Sight) -> PathJudgement | None:
        """Find the place of the rover; return a refusal if it is unknown or off the path."""
        settings = sight.snapshot.settings
        if sight.pose is None:
            missing = sight.time - self._pose_time
            if missing <= settings.parameters.monitor_timeout:
                return None
            return refusal(NO_POSE, f"the rover's pose is not known for {missing:.1f} s")
        self._pose_time = sight.time
        last = self.finding.place
        seen = None if last is None else last.index
        place = path.find_place(sight.pose, seen, settings.rover.wheel.radius)
        self.finding = replace(self.finding, place=place)
        most = settings.monitor_offset
        if place.offset <= most:
            return None
        reason = f"the rover is {place.offset:.2f} m beside its path, limit {most:.2f} m"
        return refusal(OFF_PATH, reason)

    def _miss_joints(self, sight: Sight) -> PathJudgement | None:
        """Return a refusal if the suspension is compared, and is no longer measured."""
        limits = sight.snapshot.settings.parameters
        if not limits.monitor_mismatch:
            return None
        if sight.snapshot.measured_pose is not None:
            self._joints_time = sight.time
        missing = 0.0 if self._joints_time is None else sight.time - self._joints_time
        if missing <= limits.monitor_timeout:
            return None
        reason = f"suspension angles and odometry are not known together for {missing:.1f} s"
        return refusal(NO_JOINTS, reason)

    def _compare_suspension(self, sight: Sight) -> None:
        """Compare measured and predicted suspension where the rover stands."""
        report = sight.snapshot.compare_standing()
        if report is not None:
            if sight.time - self._compared_time > DRIFT_TIME:  # what was meanwhile is not known
                self._agreed_time = sight.time
            self.finding = replace(self.finding, mismatch=dict(report.suspension_mismatch))
            self._compared_time = sight.time
        elif sight.time - self._compared_time > DRIFT_TIME:
            self.finding = replace(self.finding, mismatch={})
        if not self.finding.drift > sight.snapshot.settings.parameters.monitor_mismatch:
            self._agreed_time = sight.time

    def _refuse_drift(self, sight: Sight) -> PathJudgement | None:
        """Return a refusal if the suspension has differed too much for some time."""
        most, latest = sight.snapshot.settings.parameters.monitor_mismatch, self.finding.mismatch
        if most == 0.0 or self._compared_time - self._agreed_time <= DRIFT_TIME:
            return None
        joint = max(latest, key=lambda name: abs(latest[name]))
        reason = (
            f"measured and predicted suspension differ by {latest[joint]:+.3f} rad at {joint}, "
            f"limit {most:.3f} rad: map, pose or model are wrong here"
        )
        return refusal(SUSPENSION, reason)

    def _judge_rest(self, path: WatchedPath, sight: Sight) -> PathJudgement | None:
        """Judge the rest if map, settings or marked places are new; return it if it is refused."""
        snapshot = sight.snapshot
        missing = snapshot.refuse_map()
        if missing is not None:
            return missing
        judged_on = snapshot.terrain, snapshot.settings, snapshot.marked
        before = self._judged_on
        if before is not None and (before == judged_on or sight.time < self._pause_end):
            return None
        begin = time.monotonic()
        judgement = self._check_rest(path, snapshot)
        taken = time.monotonic() - begin
        self._pause_end = sight.time + taken + min(taken * (1.0 / SHARE - 1.0), MAX_PAUSE)
        self._judged_on = judged_on
        self.finding = replace(self.finding, judgement=judgement, judged=self.finding.judged + 1)
        if judgement.traversable:
            return None
        assert judgement.candidate is not None
        away = judgement.candidate.passable_length
        return replace(judgement, reason=f"{away:.2f} m ahead: {judgement.reason}")

    def _check_rest(self, path: WatchedPath, snapshot: Snapshot) -> PathJudgement:
        """Judge the part of the path just ahead, and the rest if that may be driven.

        What is refused whatever the errors of the map does not wait for them to be allowed for.
        """
        first = 0 if self.finding.place is None else self.finding.place.index
        length = NEAR * snapshot.settings.rover.wheel.radius
        near = int(np.searchsorted(path.distances, path.distances[first] + length)) + 1
        if near < len(path.poses):
            ahead = path.poses[first:near]
            cut = _cut_map(snapshot, ahead)
            is_exact = cut.terrain is None or cut.terrain.elevation_std is None
            for known in (cut,) if is_exact else (_take_as_exact(cut), cut):
                judgement = known.check_path(ahead, stop_at_failure=True)
                if not judgement.traversable:
                    return judgement
        return snapshot.check_path(path.poses[first:], stop_at_failure=True)


def _take_as_exact(snapshot: Snapshot) -> Snapshot:
    """Return a snapshot whose map has no errors, and nothing else has."""
    settings = snapshot.settings
    query = replace(settings.query, map_sigmas=0.0, accepted_chance=1.0)
    return replace(snapshot, settings=replace(settings, query=query))


def _cut_map(snapshot: Snapshot, poses: NDArray[np.float64]) -> Snapshot:
    """Return a snapshot with the map around poses (n, 3) alone: a large one takes long to pack."""
    known, reach = snapshot.known_map, swing_radius(snapshot.settings.rover)
    assert known is not None
    try:
        cut = cut_around(known.terrain, poses[:, :2], AROUND * reach)
    except TerrainError:  # nothing is known there
        return snapshot
    return replace(snapshot, known_map=replace(known, terrain=cut, received=cut, cells=None))


def describe_watch(finding: Finding, enabled: bool, tolerance: float) -> Health:
    """Return level, text and values of a finding.

    Args:
        finding: What was found last.
        enabled: Whether accepted paths are watched.
        tolerance: Difference of measured and predicted suspension angles [rad] that is no warning.
    """
    place, judgement, drift = finding.place, finding.judgement, finding.drift
    values = {
        "monitor": enabled,
        "state": finding.state,
        "path_hash": finding.path_hash,
        "judgements": finding.judged,
    }
    if place is not None:
        values["remaining"] = f"{place.remaining:.3f} m"
        values["offset"] = f"{place.offset:.3f} m"
    if finding.mismatch:
        values["suspension_drift"] = f"{drift:.4f} rad"
    for joint, difference in finding.mismatch.items():
        values[f"mismatch {joint}"] = f"{difference:+.4f} rad"
    level, text = OK, finding.state
    if enabled and finding.state == IDLE:
        level, text = WARN, "stop: no path is watched; the rover may drive accepted paths"
    elif enabled and finding.state == STOPPED and judgement is not None:
        level, text = ERROR, f"stop ({judgement.code}): {judgement.reason}"
    elif drift > tolerance:
        level, text = (
            WARN,
            (
                f"measured and predicted suspension differ by {drift:.3f} rad, "
                f"tolerance {tolerance:.3f} rad"
            ),
        )
    elif not enabled:
        text = "no path is watched: the parameter monitor is false"
    return Health(level, text, values)
