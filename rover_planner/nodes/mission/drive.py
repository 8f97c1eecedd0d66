# SPDX-License-Identifier: Apache-2.0
"""Drives a rover to its goal: watches plan and rover, and asks for another plan if needed."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rover_planner.angles import wrap
from rover_planner.errors import DriveFailedError
from rover_planner.planning.marked_places import MARKED_CODE
from rover_planner.planning.navigation.watched_path import TURN_LENGTH, WatchedPath

if TYPE_CHECKING:  # help of programs comes without ROS
    from rover_planner.nodes.mission.client import Answer, MissionPlanner

Poses = NDArray[np.float64]
"""(n, 3) x, y [m] and yaw [rad], map frame."""
MAX_PLANS = 100
"""Largest number of plans to one goal."""
MAX_STOPS = 3
"""Largest number of stops at one place before the drive is given up."""
RETREAT = 0.5
"""Distance by which the rover drives back where no path begins [m]."""
REST_TIME, LOOK_TIME, LONGEST_BRAKING = 1.0, 0.2, 10.0
"""A rover that is to stand rests when it has not moved for so long; time between two looks at it;
time after which it is taken to rest, whatever it does [s]."""
STILL = 0.02
"""Motion below which a rover stands [m]; a turn counts as in `WatchedPath`."""
SAME_PLACE = 0.1
"""Distance below which two stops are at one place [m]."""


@dataclass(frozen=True)
class DriveSettings:
    """Distances and times by which a drive is watched."""

    position_tolerance: float = 0.15
    """Distance from the end of a plan that counts as there [m]."""
    heading_tolerance: float = 0.2
    """Difference from its heading that counts as there [rad]."""
    period: float = 2.0
    """Time between two looks at the rest of the plan [s]."""
    timeout: float = 3600.0
    """Longest time for the drive to a goal [s]."""
    patience: float = 15.0
    """Time for which a rover may stand before another path is asked for [s]."""


class Stretch(NamedTuple):
    """The part of a plan that was driven."""

    pose: Poses
    """(3,) where the rover is."""
    hindrance: str
    """Reason why it does not go on; empty at the end of the plan."""
    is_marked: bool
    """True if a place ahead was marked as impassable: the rover may be stuck."""
    behind: Poses
    """(n, 3) waypoints of the plan up to there."""


class Drive:
    """A drive along a plan, and along another one where it cannot be driven to the goal.

    That is where the newest map refuses the rest of it, where the rover stands although it is to
    drive, and where the plan ends before the goal. Where no path begins, and where the rover stops
    again, it first drives back along its plan; and where a place ahead was marked as impassable.
    """

    def __init__(
        self,
        planner: "MissionPlanner",
        goal: Sequence[float],
        settings: DriveSettings,
        report: Callable[[str], object],
    ):
        """Begin.

        Args:
            planner: Asks for the plans, and has the rover follow them.
            goal: Where to, x, y [m] and yaw [rad].
            settings: How it is watched.
            report: Takes events in words.
        """
        self._planner, self._goal = planner, goal
        self._settings, self._report = settings, report
        self._deadline = time.monotonic() + settings.timeout
        self._stopped_at, self._stops = np.full(3, np.inf), 0
        self._trail: Poses = np.zeros((0, 3))

    def run(self, poses: Sequence[Sequence[float]]) -> Poses:
        """Drive a plan and those that follow it; return where the rover is at its end (3,).

        Raises:
            DriveFailedError: There is no path from where the rover is, it does not get on, or it
                takes too long.
        """
        plan: Poses = np.array(poses)
        for _ in range(MAX_PLANS):
            stretch = self._follow(plan)
            if not stretch.hindrance and not self._describe_miss(plan[-1], self._goal):
                return stretch.pose
            plan = self._find_plan(stretch)
        raise DriveFailedError(f"the goal is not reached after {MAX_PLANS} plans")

    def _count_stops(self, pose: Poses) -> int:
        """Return how often in turn the rover (3,) has stopped where it stops now."""
        is_same = math.dist(pose[:2], self._stopped_at[:2]) < SAME_PLACE
        self._stopped_at, self._stops = pose, self._stops + 1 if is_same else 1
        return self._stops

    def _find_plan(self, stretch: Stretch) -> Poses:
        """Return the plan (n, 3) on which the rover goes on after a stretch."""
        if WatchedPath(stretch.behind).distances[-1] > SAME_PLACE:
            self._trail = stretch.behind
        pose, stops = self._stand(stretch.pose), 0
        if stretch.hindrance:
            self._report(stretch.hindrance)
            stops = self._count_stops(pose)
        if stops > MAX_STOPS:
            raise DriveFailedError(
                f"{MAX_STOPS} other paths led nowhere from {_describe(pose)}: {stretch.hindrance}"
            )
        answer = None if stops >= 2 or stretch.is_marked else self._ask(pose)
        if answer is None or not answer.traversable:
            went_back = self._go_back()
            if went_back or answer is None:
                pose = self._stand(pose)
                answer = self._ask(pose)
        if not answer.traversable:
            raise DriveFailedError(f"no path on from {_describe(pose)}: {answer.reason}")
        self._report(f"another plan from {_describe(pose)}")
        return np.array(answer.poses)

    def _ask(self, pose: Poses) -> "Answer":
        """Ask for a path to the goal from a pose (3,)."""
        return self._planner.ask(pose.tolist(), self._goal)

    def _follow(self, plan: Poses) -> Stretch:
        """Follow a plan (n, 3) to its end, or to where something hinders the rover."""
        path, index, settings = WatchedPath(plan), 0, self._settings
        standstill, rest = Standstill(settings.patience), Standstill(REST_TIME)
        self._planner.send_path(plan)

        def is_there(pose: Poses) -> bool:
            nonlocal index
            index = path.find_place(pose, index).index
            rests, ended = rest.is_reached(pose, time.monotonic()), self._planner.has_ended()
            if ended is not None:
                return ended
            return rests and path.is_end(index) and not self._describe_miss(pose, plan[-1])

        while True:
            pose = self._planner.wait_for_pose(is_there, settings.period)
            behind = plan[: index + 1]
            if is_there(pose):
                return Stretch(pose, self._describe_miss(pose, plan[-1]), False, behind)
            rest_of_plan = self._planner.check(plan[index:])
            if not rest_of_plan.traversable:
                text = f"the rest of the plan is refused: {rest_of_plan.reason}"
                return Stretch(pose, text, rest_of_plan.code == MARKED_CODE, behind)
            now = time.monotonic()
            if standstill.is_reached(pose, now):
                text = f"the rover has stood for {settings.patience:g} s on its way"
                return Stretch(pose, text, False, behind)
            if now > self._deadline:
                raise DriveFailedError(
                    f"waited {settings.timeout:.0f} s in vain for the rover to get there; it is "
                    f"at {_describe(pose)}"
                )

    def _describe_miss(self, pose: Poses, end: Poses | Sequence[float]) -> str:
        """Return by how much a pose (3,) misses the end of a path; empty within the tolerances."""
        off, turned = math.dist(pose[:2], end[:2]), abs(float(wrap(pose[2] - end[2])))
        settings = self._settings
        if off <= settings.position_tolerance and turned <= settings.heading_tolerance:
            return ""
        return (
            f"the rover has ended {off:.2f} m and {turned:.2f} rad from the end of its path, "
            f"tolerances {settings.position_tolerance:g} m and {settings.heading_tolerance:g} rad"
        )

    def _go_back(self) -> bool:
        """Let the rover drive back along the waypoints that it has passed, if they pass that way.

        Where it stands at a limit, by the width of its deviation from the plan, no path begins.
        """
        if len(self._trail) < 2:
            return False
        lengths = WatchedPath(self._trail).distances
        is_back = lengths >= lengths[-1] - RETREAT
        back, self._trail = self._trail[is_back][::-1], self._trail[~is_back]
        if not self._planner.check(back).traversable:
            return False
        self._report(f"back to {_describe(back[-1])}")
        return not self._follow(back).hindrance

    def _stand(self, pose: Poses) -> Poses:
        """Let the rover stand at a pose (3,); return where it has come to rest.

        A plan from where it still moved would begin beside it, and a turn on the spot stay there.
        """
        self._planner.send_path(pose[None, :])
        rest = Standstill(REST_TIME)
        end = time.monotonic() + LONGEST_BRAKING
        while time.monotonic() < end and not rest.is_reached(pose, time.monotonic()):
            pose = self._planner.wait_for_pose(lambda _: False, LOOK_TIME)
        return pose


class Standstill:
    """Notices that a rover does not get on."""

    def __init__(self, patience: float):
        """Begin with a rover that moves.

        Args:
            patience: Time for which it may stand [s].
        """
        self._patience = patience
        self._pose: Poses | None = None
        self._since = 0.0

    def is_reached(self, pose: Poses, now: float) -> bool:
        """Return whether the rover has stood for too long.

        Args:
            pose: Where the rover is.
            now: Time [s].
        """
        if self._pose is None or _is_away(pose, self._pose):
            self._pose, self._since = pose, now
        return now - self._since > self._patience


def _is_away(pose: Poses, other: Poses) -> bool:
    """Return whether two poses (3,) differ by more than a rover that stands moves."""
    turn = TURN_LENGTH * float(wrap(pose[2] - other[2]))
    return math.hypot(*(pose[:2] - other[:2]), turn) > STILL


def _describe(pose: Poses) -> str:
    """Return a pose (3,) as text."""
    return ", ".join(f"{value:.2f}" for value in pose)
