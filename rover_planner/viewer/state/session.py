"""The state behind the page: rover, terrain, start, goal, and the model's answer for them."""

import dataclasses
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.errors import RoverError
from rover_physics.files.validation import Key
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
from rover_planner.studies.rover_values import with_value
from rover_planner.viewer.state.comparison import PolicyVerdict, judge_by_policy
from rover_planner.viewer.state.trajectory import Trajectory

REFUSALS = (RoverError, PlanningError)
"""Errors that say what is wrong with a request."""
Pose = tuple[float, float, float]


@dataclass(frozen=True)
class ShownPath:
    """The path that is shown, and its verdict."""

    index: int
    """Its index among the candidates of the last answer."""
    candidate: Candidate
    """The path as it was judged last."""
    trajectory: Trajectory
    """The drive along it."""
    summary: str
    """What was judged and how long that took; empty for a recorded path."""
    by_policy: tuple[PolicyVerdict, ...] = ()
    """Its verdicts under all torque policies; empty for a replay, whose soil is not known."""

    @property
    def verdict(self) -> Verdict:
        """Whether the rover can drive it, and why not."""
        return self.candidate.verdict


class ViewSession:
    """Keeps the last good state: a refused change alters nothing but `refusal`."""

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        start: Pose,
        goal: Pose,
        options: PathQueryOptions | None = None,
    ):
        """Plan from start to goal.

        Args:
            rover: The rover.
            terrain: The ground.
            start: x, y [m] and yaw [rad], map frame.
            goal: The same.
            options: How candidates are made and judged (default: 5 candidates, 0.5 m apart).

        Raises:
            RoverError, PlanningError: The rover, the poses or the options are invalid.
        """
        self.rover, self.terrain = rover, terrain
        self.start, self.goal = start, goal
        self.options = options or PathQueryOptions(count=5, spacing=0.5)
        self.arm_angles: dict[str, float] = {}
        """Angles [rad] of the arm's joints by name; joints that are not named are stowed."""
        self.refusal = ""
        """Why the last change was refused, empty if it was not."""
        self.recorded = False
        """Whether the path is a recorded one, so that no other is planned."""
        self.answer: PathAnswer
        self.shown: ShownPath
        self._plan()

    def _plan(self) -> None:
        """Judge all candidate paths, or the recorded path, and show the one that is chosen."""
        began = time.perf_counter()
        if self.recorded:
            poses = self.shown.candidate.poses
            only = self._check(self.rover, poses, self.arm_angles)
            self.answer = choose((only,))
        else:
            self.answer = answer_path_query(
                self.rover, self.terrain, self.start, self.goal, self.options, self.arm_angles
            )
        passable = sum(candidate.verdict.traversable for candidate in self.answer.candidates)
        total = len(self.answer.candidates)
        words = f"{passable} of {total} candidate paths passable, judged in"
        if self.recorded:
            words = "recorded path judged again in"
        self._show(self.answer.nearest, self.answer.chosen, f"{words} {_milliseconds(began)}")

    def _check(
        self, rover: Rover, poses: NDArray[np.float64], arm_angles: dict[str, float]
    ) -> Candidate:
        """Judge a path up to its first failure, where its playback ends."""
        return check_path(
            rover, self.terrain, poses, self.options, arm_angles, stop_at_failure=True
        )

    def _show(self, index: int, candidate: Candidate, summary: str) -> None:
        trajectory = Trajectory(self.rover, candidate.prediction, candidate.verdict)
        by_policy: tuple[PolicyVerdict, ...] = ()
        if not self.recorded:
            by_policy = judge_by_policy(
                self.rover, self.terrain, candidate, self.options, self.arm_angles
            )
        self.shown = ShownPath(index, candidate, trajectory, summary, by_policy)

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """The candidates of the last answer, with the shown one as it was judged last."""
        candidates = list(self.answer.candidates)
        candidates[self.shown.index] = self.shown.candidate
        return tuple(candidates)

    def sweep_options(self) -> SweepOptions:
        """Return the options of the model that hold now."""
        return self.options.sweep_options(self.arm_angles)

    def show_candidate(self, index: int) -> None:
        """Show another candidate of the last answer.

        Raises:
            PlanningError: The last answer has no candidate of this index.
        """
        candidates = self.answer.candidates
        if not 0 <= index < len(candidates):
            raise PlanningError(f"no path {index + 1}; there are paths 1 to {len(candidates)}")
        self._show(index, candidates[index], self.shown.summary)

    def plan_to(self, goal: NDArray[np.float64]) -> bool:
        """Plan to a goal (2,) [m] with the yaw of the straight line there.

        Returns:
            Whether the goal was accepted, as of all changes: if not, `refusal` says why.
        """
        return self._take_ends(self.start, _facing(self.start, goal))

    def plan_from(self, start: NDArray[np.float64]) -> bool:
        """Plan from a start (2,) [m] with the yaw of the straight line to the goal."""
        ahead = np.asarray(self.goal[:2]) - np.asarray(start)
        yaw = float(np.arctan2(ahead[1], ahead[0]))
        pose = (float(start[0]), float(start[1]), yaw)
        return self._take_ends(pose, (self.goal[0], self.goal[1], yaw))

    def _take_ends(self, start: Pose, goal: Pose) -> bool:
        return self._plan_with(start=start, goal=goal, recorded=False)

    def change_options(self, **changes: object) -> bool:
        """Change fields of PathQueryOptions and plan again."""
        options = dataclasses.replace(self.options, **changes)  # type: ignore[arg-type]
        return self._plan_with(options=options)

    def take_rover(self, rover: Rover) -> bool:
        """Take another rover and plan again."""
        return self._plan_with(rover=rover, arm_angles={})

    def plan_again(self) -> bool:
        """Judge all candidates again, after a change of the rover."""
        return self._plan_with()

    def _plan_with(self, **changes: object) -> bool:
        """Plan with other attributes; restore the old ones if that is refused."""
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
        """Change a number of the rover and judge the shown path again.

        The other candidates keep their verdicts until `plan_again`.

        Args:
            keys: Keys of the number in the rover file; several get the same value.
            value: The new value.

        Returns:
            Whether it was accepted; if not, `refusal` says why and the last good rover stays.
        """
        try:
            rover = with_value(self.rover, keys, value)
        except REFUSALS as error:
            self.refusal = str(error)
            return False
        return self._judge_shown(rover, self.arm_angles)

    def change_arm(self, joint: str, angle: float) -> bool:
        """Turn a joint of the arm to an angle [rad]; otherwise like `change_rover`."""
        return self._judge_shown(self.rover, {**self.arm_angles, joint: angle})

    def _judge_shown(self, rover: Rover, arm_angles: dict[str, float]) -> bool:
        """Judge the shown path with another rover or arm; keep both if they are accepted."""
        began = time.perf_counter()
        try:
            poses = self.shown.candidate.poses
            candidate = self._check(rover, poses, arm_angles)
        except REFUSALS as error:
            self.refusal = str(error)
            return False
        self.rover, self.arm_angles, self.refusal = rover, arm_angles, ""
        words = f"path of {candidate.length:.1f} m judged again in {_milliseconds(began)}"
        self._show(self.shown.index, candidate, words)
        return True

    def replay(self, prediction: PathPrediction, reasons: Sequence[str]) -> None:
        """Show a recorded prediction with the recorded reasons (n,) of its waypoints."""
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


def _milliseconds(began: float) -> str:
    """Return the time since `began` as text."""
    return f"{1e3 * (time.perf_counter() - began):.0f} ms"


def _as_pose(pose: NDArray[np.float64]) -> Pose:
    x, y, yaw = pose.tolist()
    return x, y, yaw


def _facing(start: Pose, goal: NDArray[np.float64]) -> Pose:
    """Return the pose at a goal (2,) with the yaw of the straight line from start to goal."""
    ahead = np.asarray(goal, dtype=float) - np.asarray(start[:2])
    return float(goal[0]), float(goal[1]), float(np.arctan2(ahead[1], ahead[0]))
