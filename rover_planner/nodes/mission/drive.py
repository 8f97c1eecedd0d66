"""Drives a rover to its goal: watches plan and rover, and asks for another plan if needed."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from rover_planner.nodes.mission.standstill import Standstill, Stops
from rover_planner.planning.navigation.watched_path import WatchedPath

Poses = NDArray[np.float64]
"""(n, 3) x, y [m] and yaw [rad], map frame."""
MAX_PLANS = 100
"""Largest number of plans on the way to one goal."""
MAX_STOPS = 3
"""Largest number of stops at one place before the drive is given up."""


class DriveFailedError(Exception):
    """The rover did not reach the end of its path; the text names the reason."""


class RoverClient(Protocol):
    """What a drive needs of server and rover."""

    def ask(self, start: Sequence[float], goal: Sequence[float]) -> dict[str, Any]:
        """Return `traversable`, `reason` and the `poses` of a way from start to goal."""

    def send_path(self, poses: Poses) -> None:
        """Let the rover follow a path."""

    def check(self, poses: Poses) -> str:
        """Return why the server refuses a path on its newest map, empty if it passes."""

    def wait_for_pose(self, is_wanted: Callable[[Poses], bool], seconds: float) -> Poses:
        """Return the first measured pose (3,) that is wanted, or the last one in time."""


@dataclass(frozen=True)
class DriveSettings:
    """How a drive is watched."""

    within: float = 0.2
    """Distance from the end of a plan that counts as there [m]."""
    period: float = 2.0
    """Time between two looks at the rest of the plan [s]."""
    timeout: float = 3600.0
    """Longest time for the way to a goal [s]."""
    patience: float = 15.0
    """Time for which a rover may stand before another way is asked for [s]."""


def drive_to(
    client: RoverClient,
    goal: Sequence[float],
    plan: Sequence[Sequence[float]],
    settings: DriveSettings,
    tell: Callable[[str], object],
) -> None:
    """Drive a plan, and ask for another one where it cannot be driven to the goal.

    That is where the newest map refuses the rest of it, where the rover stands although it is to
    drive, and where the plan ends before the goal.

    Args:
        client: Server and rover.
        goal: Where to, x, y [m] and yaw [rad].
        plan: Poses of the first plan.
        settings: How it is watched.
        tell: Takes in words what happens.

    Raises:
        DriveFailedError: There is no way from where the rover is, it does not get on, or it takes
            too long.
    """
    deadline = time.monotonic() + settings.timeout
    stops = Stops()
    for _ in range(MAX_PLANS):
        pose, hindrance = _follow(client, np.array(plan), settings, deadline)
        ends_at_goal = math.dist(plan[-1][:2], goal[:2]) < settings.within
        if not hindrance and ends_at_goal:
            return
        if hindrance:
            client.send_path(pose[None, :])  # it stands there
            tell(hindrance)
            if stops.count(pose) > MAX_STOPS:
                raise DriveFailedError(
                    f"{MAX_STOPS} other ways led nowhere from {_describe(pose)}: {hindrance}"
                )
        answer = client.ask(pose.tolist(), goal)
        if not answer["traversable"]:
            raise DriveFailedError(f"no way on from {_describe(pose)}: {answer['reason']}")
        plan = answer["poses"]
        tell(f"another plan from {_describe(pose)}")
    raise DriveFailedError(f"the goal is not reached after {MAX_PLANS} plans")


def _follow(
    client: RoverClient, plan: Poses, settings: DriveSettings, deadline: float
) -> tuple[Poses, str]:
    """Follow a plan to its end; return the last pose (3,), and what hinders the rover there."""
    path, index = WatchedPath(plan), 0
    standstill = Standstill(settings.patience)
    client.send_path(plan)

    def is_there(pose: Poses) -> bool:
        nonlocal index
        index = path.find_place(pose, index).index
        return path.is_over(pose, index, settings.within)

    while True:
        pose = client.wait_for_pose(is_there, settings.period)
        if is_there(pose):
            return pose, ""
        refused = client.check(plan[index:])
        if refused:
            return pose, f"the rest of the plan is refused: {refused}"
        now = time.monotonic()
        if standstill.is_reached(pose, now):
            return pose, f"the rover has stood for {settings.patience:g} s on its way"
        if now > deadline:
            raise DriveFailedError(
                f"waited {settings.timeout:.0f} s in vain for the rover to get there; it is at "
                f"{_describe(pose)}"
            )


def _describe(pose: Poses) -> str:
    """Return a pose (3,) as text."""
    return ", ".join(f"{value:.2f}" for value in pose)
