"""What is looked at: a rover, a terrain, where from and where to, and what the model says."""

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import RoverError
from rover_physics.prediction.path_prediction import PathPrediction
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.verdict import Verdict, judge
from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import (
    Candidate,
    PathAnswer,
    PathQueryOptions,
    answer_path_query,
    check_path,
    choose,
)
from rover_planner.studies.rover_values import Key, with_value
from rover_planner.viewer.state.journey import Journey

REFUSALS = (RoverError, PlanningError)
Pose = tuple[float, float, float]


@dataclass(frozen=True)
class Shown:
    """The path that is shown, and how it was judged."""

    index: int
    """Which candidate of the last answer it is."""
    candidate: Candidate
    """The path, as it was judged last."""
    journey: Journey
    """What is played of it."""
    judged: str
    """What was judged for it and how long that took; empty where nothing was."""

    @property
    def verdict(self) -> Verdict:
        """Whether the rover can drive it, and why not."""
        return self.candidate.verdict


class ViewSession:
    """Keeps the last good state: what is refused changes nothing, and says why."""

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        start: Pose,
        goal: Pose,
        options: PathQueryOptions | None = None,
    ):
        """Plan from start to goal, x, y [m] and yaw [rad] each.

        Raises:
            RoverError, PlanningError: The rover, the poses or the options make no sense.
        """
        self.rover, self.terrain = rover, terrain
        self.start, self.goal = start, goal
        self.options = options or PathQueryOptions(count=5, spacing=0.5)
        self.arm_angles: dict[str, float] = {}
        self.refusal = ""
        """Why the last change was refused, empty where it was not."""
        self.recorded = False
        """Whether the path is a recorded one, so that no other is planned for it."""
        self.answer: PathAnswer
        self.shown: Shown
        self._plan()

    def _plan(self) -> None:
        """Judge the candidate paths, or the one path where a recorded one is looked at."""
        began = time.perf_counter()
        if self.recorded:
            poses = self.shown.candidate.poses
            only = check_path(self.rover, self.terrain, poses, self.options, self.arm_angles)
            self.answer = choose((only,))
        else:
            self.answer = answer_path_query(
                self.rover, self.terrain, self.start, self.goal, self.options, self.arm_angles
            )
        passable = sum(one.verdict.traversable for one in self.answer.candidates)
        total = len(self.answer.candidates)
        words = f"{passable} of {total} candidate paths passable, judged in"
        if self.recorded:
            words = "recorded path judged again in"
        self._show(self.answer.nearest, self.answer.chosen, f"{words} {_milliseconds(began)}")

    def _show(self, index: int, candidate: Candidate, judged: str) -> None:
        journey = Journey(self.rover, candidate.prediction, candidate.verdict)
        self.shown = Shown(index, candidate, journey, judged)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The candidate paths of the last answer; the one that is shown as it was judged last."""
        candidates = list(self.answer.candidates)
        candidates[self.shown.index] = self.shown.candidate
        return tuple(candidates)

    def sweep_options(self) -> SweepOptions:
        """Return what the model is asked with now."""
        return self.options.sweep_options(self.arm_angles)

    def show_candidate(self, index: int) -> None:
        """Show another candidate of the last answer, by its index.

        Raises:
            PlanningError: The last answer has no such candidate.
        """
        candidates = self.answer.candidates
        if not 0 <= index < len(candidates):
            raise PlanningError(f"no path {index + 1}; there are paths 1 to {len(candidates)}")
        self._show(index, candidates[index], self.shown.judged)

    def plan_to(self, goal: NDArray[np.float64]) -> bool:
        """Plan to a place (2,) [m], arriving on the straight way; return whether it was taken."""
        return self._take_places(self.start, _facing(self.start, goal))

    def plan_from(self, start: NDArray[np.float64]) -> bool:
        """Plan from a place (2,) [m], heading for the goal; return whether it was taken."""
        towards = np.asarray(self.goal[:2]) - np.asarray(start)
        yaw = float(np.arctan2(towards[1], towards[0]))
        placed = (float(start[0]), float(start[1]), yaw)
        return self._take_places(placed, (self.goal[0], self.goal[1], yaw))

    def _take_places(self, start: Pose, goal: Pose) -> bool:
        return self._try(start=start, goal=goal, recorded=False)

    def take_options(self, **changes: object) -> bool:
        """Change fields of PathQueryOptions and plan anew; return whether it was taken."""
        return self._try(options=dataclasses.replace(self.options, **changes))  # type: ignore[arg-type]

    def take_rover(self, rover: Rover) -> bool:
        """Take another rover and plan anew; return whether it was taken."""
        return self._try(rover=rover, arm_angles={})

    def _try(self, **changes: object) -> bool:
        """Plan with other attributes; put the old ones back where that is refused."""
        before = {name: getattr(self, name) for name in changes}
        for name, value in changes.items():
            setattr(self, name, value)
        try:
            self._plan()
        except REFUSALS as error:
            for name, value in before.items():
                setattr(self, name, value)
            self.refusal = str(error)
            return False
        self.refusal = ""
        return True

    def change_rover(self, keys: Sequence[Key], value: float) -> bool:
        """Change a number of the rover and judge the path that is shown again, at once.

        The other candidates keep their verdicts until `plan_again`.

        Args:
            keys: Where the number is in the rover file.
            value: What it is to be.

        Returns:
            Whether it was taken; if not, `refusal` says why and the last good rover stays.
        """
        try:
            rover = with_value(self.rover, keys, value)
        except REFUSALS as error:
            self.refusal = str(error)
            return False
        return self._judge_shown(rover, self.arm_angles)

    def change_arm(self, joint: str, angle: float) -> bool:
        """Turn a joint of the arm to an angle [rad], as `change_rover`."""
        return self._judge_shown(self.rover, {**self.arm_angles, joint: angle})

    def _judge_shown(self, rover: Rover, arm_angles: dict[str, float]) -> bool:
        began = time.perf_counter()
        try:
            poses = self.shown.candidate.poses
            candidate = check_path(rover, self.terrain, poses, self.options, arm_angles)
        except REFUSALS as error:
            self.refusal = str(error)
            return False
        self.rover, self.arm_angles, self.refusal = rover, arm_angles, ""
        words = f"path of {candidate.length:.1f} m judged again in {_milliseconds(began)}"
        self._show(self.shown.index, candidate, words)
        return True

    def replay(self, prediction: PathPrediction, reasons: Sequence[str]) -> None:
        """Show a recorded prediction as it is, with the reasons (n,) that were given for it."""
        first = next((k for k, reason in enumerate(reasons) if reason), -1)
        verdict = dataclasses.replace(
            judge(self.rover, prediction),
            traversable=first < 0,
            reasons=tuple(reasons),
            first_failure=first,
            reason=reasons[first] if first >= 0 else "",
        )
        candidate = Candidate(prediction.poses, prediction, verdict, (0.0, 0.0))
        self.answer = PathAnswer((candidate,), 0 if first < 0 else -1, 0)
        self.start, self.goal = (_as_pose(prediction.poses[row]) for row in (0, -1))
        self.recorded = True
        self._show(0, candidate, "recorded")

    def plan_again(self) -> bool:
        """Judge all candidates anew, after the rover was changed; return whether that worked."""
        return self._try()


def _milliseconds(began: float) -> str:
    """Return the time since `began` as text."""
    return f"{1e3 * (time.perf_counter() - began):.0f} ms"


def _as_pose(pose: NDArray[np.float64]) -> Pose:
    x, y, yaw = pose.tolist()
    return x, y, yaw


def _facing(start: Pose, goal: NDArray[np.float64]) -> Pose:
    """Return the goal (2,) with the heading of the straight way there."""
    way = np.asarray(goal, dtype=float) - np.asarray(start[:2])
    return float(goal[0]), float(goal[1]), float(np.arctan2(way[1], way[0]))
