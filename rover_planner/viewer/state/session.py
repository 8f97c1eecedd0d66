# SPDX-License-Identifier: Apache-2.0
"""The state behind the page: what visitors want judged, and what was judged last."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice
from typing import Any

import numpy as np

from rover_physics.errors import RoverError
from rover_physics.files.validation import Key
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.planning.assumptions import Assumptions
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.planning.search.query import LatticeSettings
from rover_planner.studies.rover_values import with_value
from rover_planner.viewer.state.background_work import BackgroundWork, Progress
from rover_planner.viewer.state.context import name_ground
from rover_planner.viewer.state.judging import JudgeRequest, judge_request, show_recorded
from rover_planner.viewer.state.scenario import Pose, Scenario, Shown

REFUSALS = (RoverError, PlanningError)
"""Errors that say what is wrong with a request."""


class ViewSession:
    """The scenario that is wanted and what is shown: frozen values that are replaced as a whole.

    It judges at once, or in the background after `judge_in_background`. All changes belong to one
    thread, the owner's. A refused change alters nothing but `refusal`.
    """

    def __init__(
        self,
        rover: Rover,
        terrain: Terrain,
        start: Pose,
        goal: Pose,
        options: PathQueryOptions | None = None,
        search: LatticeSettings | None = None,
    ):
        """Plan from start to goal; no path around obstacles is searched yet.

        Args:
            rover: The rover.
            terrain: The ground.
            start: x, y [m] and yaw [rad], map frame.
            goal: The same.
            options: How candidates are made and judged (default: 5 candidates, 0.5 m apart).
            search: Settings of searches around obstacles (default: for 2 s).

        Raises:
            RoverError, PlanningError: The rover, the poses or the options are invalid.
        """
        options = options or PathQueryOptions(count=5, spacing=0.5)
        self.wanted = Scenario(
            rover, rover, terrain, start, goal, options, {}, search=search or LatticeSettings()
        )
        """The scenario that visitors want judged."""
        self.ground_name = name_ground(terrain)
        """Name of the ground on the page; by default its size."""
        self.refusal = ""
        """Reason why the last change was refused, empty if it was not."""
        self.is_stopped = False
        """True if the judgement of `wanted` was cancelled or failed."""
        self._background: BackgroundWork[JudgeRequest, Shown] | None = None
        self._judge = partial(judge_request, memory=EdgeMemory())
        self._asked = JudgeRequest(self.wanted)
        """The newest request."""
        *_, self.shown = islice(_results(self._judge(self._asked)), 2)  # and not what it searches
        """The last finding."""
        self._index = self.shown.index
        """Index of the candidate that is wanted."""

    # What is shown.

    @property
    def scenario(self) -> Scenario:
        """Rover, ground, ends and options of what is shown; `wanted` has the newest values."""
        return self.shown.scenario

    @property
    def rover(self) -> Rover:
        """The rover of what is shown."""
        return self.shown.scenario.rover

    @property
    def terrain(self) -> Terrain:
        """Its ground."""
        return self.shown.scenario.terrain

    @property
    def is_outdated(self) -> bool:
        """True if the shown verdict is of other values than those that are wanted."""
        return self.shown.scenario is not self.wanted

    @property
    def has_old_candidates(self) -> bool:
        """True if the other candidates were judged for other values."""
        return self.shown.answered is not self.wanted

    # What is wanted. All return whether the change was accepted; if not, `refusal` says why. In
    # the background a change may be accepted and still be refused when it is judged.

    def show_candidate(self, index: int) -> bool:
        """Show another candidate of the last answer.

        Raises:
            PlanningError: There is no candidate of this index, or other paths are wanted.
        """
        count = len(self.shown.answer.candidates)
        if not 0 <= index < count:
            raise PlanningError(f"no path {index + 1}; there are paths 1 to {count}")
        if not self.wanted.has_paths_of(self.shown.answered):
            raise PlanningError("the listed paths are old; judge again first")
        return self._ask(self.wanted, index)

    def plan_to(self, goal: Floats) -> bool:
        """Plan to a goal (2,) [m] with the yaw of the straight line there."""
        start = self.wanted.start
        return self._want(start=start, goal=_facing(start, goal), recorded=None)

    def plan_from(self, start: Floats) -> bool:
        """Plan from a start (2,) [m] with the yaw of the straight line to the goal."""
        x, y, yaw = _facing(start, self.wanted.goal)
        pose = (float(start[0]), float(start[1]), yaw)
        return self._want(start=pose, goal=(x, y, yaw), recorded=None)

    def restore_rover(self, rover: Rover, arm_angles: Mapping[str, float]) -> bool:
        """Take other numbers of the same rover, such as those before a change.

        The shown path is judged again.
        """
        return self._judge_shown(rover=rover, arm_angles=dict(arm_angles))

    def change_options(self, **changes: object) -> bool:
        """Change options of the paths or of the model and plan again."""
        try:
            options = self.wanted.options.change(**changes)
        except RoverError as error:
            self.refusal = str(error)
            return False
        return self._want(options=options)

    def take_rover(self, rover: Rover) -> bool:
        """Take another rover as it was loaded, and plan again."""
        return self._want(loaded=rover, rover=rover, arm_angles={})

    def plan_again(self) -> bool:
        """Judge all candidates again, after a change of the rover."""
        return self._ask(self.wanted)

    def change_rover(self, keys: Sequence[Key], value: float) -> bool:
        """Change a number of the rover and judge the shown path again.

        The other candidates keep their verdicts until `plan_again`.

        Args:
            keys: Keys of the number in the rover file; several get the same value.
            value: The new value.
        """
        try:
            rover = with_value(self.wanted.rover, keys, value)
        except REFUSALS as error:
            self.refusal = str(error)
            return False
        return self._judge_shown(rover=rover)

    def change_arm(self, joint: str, angle: float) -> bool:
        """Turn a joint of the arm to an angle [rad]; otherwise like `change_rover`."""
        return self._judge_shown(arm_angles={**self.wanted.arm_angles, joint: angle})

    def take_scenario(self, scenario: Scenario) -> bool:
        """Plan for a whole scenario on the same ground."""
        return self._ask(scenario)

    def _want(self, **changes: Any) -> bool:
        """Plan with other values."""
        return self._ask(replace(self.wanted, **changes))

    def _judge_shown(self, **changes: Any) -> bool:
        """Judge the shown path again with other values; all, if others are wanted meanwhile."""
        wanted = replace(self.wanted, **changes)
        same = wanted.has_paths_of(self.shown.answered)
        is_listed = self._index < len(self.shown.answer.candidates)
        return self._ask(wanted, self._index if same and is_listed else None)

    def _ask(self, wanted: Scenario, index: int | None = None) -> bool:
        """Judge a candidate by its index, or all; without background do it at once."""
        before = None if index is None else self.shown
        request = JudgeRequest(wanted, before, index or 0)
        self.wanted, self._asked = wanted, request
        self._index = self._index if index is None else index
        self.refusal, self.is_stopped = "", False
        if self._background is not None:
            self._background.ask(request)
            return True
        try:
            for shown in _results(self._judge(request)):
                self._finish(request, shown)
        except REFUSALS as error:
            self._refuse(error)
            return False
        return True

    def _finish(self, request: JudgeRequest, shown: Shown) -> None:
        """Take what was judged; one path leaves the others as they were judged last."""
        now, before = self.shown, request.before
        if (
            before is not None
            and shown.around is before.around
            and request.scenario.has_paths_of(now.answered)
            and shown.index < len(now.answer.candidates)
        ):
            shown = replace(shown, answer=now.answer, answered=now.answered, around=now.around)
        self.shown = shown
        if request is self._asked:
            self._index = shown.index

    def _refuse(self, error: Exception) -> None:
        """Want again what was judged last."""
        self.refusal = str(error)
        self.wanted, self._index = self.shown.scenario, self.shown.index

    # In the background.

    def judge_in_background(self, wake: Callable[[], object]) -> None:
        """Judge in a thread from now on, until `close`; begin with the search that was not made.

        Args:
            wake: Called in that thread when there is something to take with `take_finished`.
        """
        self._background = BackgroundWork(self._judge, wake, "judge")
        if self.shown.needs_search:
            self._ask(self.wanted, self._index)

    @property
    def progress(self) -> Progress | None:
        """Progress of the judgement in the background; None if nothing is judged."""
        return self._background.progress if self._background is not None else None

    @property
    def has_news(self) -> bool:
        """True if there is something for `take_finished`."""
        return self._background is not None and self._background.has_news

    def take_finished(self) -> bool:
        """Take what was judged in the background; return whether there was anything.

        Raises:
            Exception: The newest judgement failed by an error that is no refusal.
        """
        done = self._background.take() if self._background is not None else []
        for one in done:
            if one.result is not None:
                self._finish(one.request, one.result)
            elif one.request is self._asked and isinstance(one.error, REFUSALS):
                self._refuse(one.error)
            elif one.request is self._asked and one.error is not None:
                self.is_stopped = True
                raise one.error
        return bool(done)

    def cancel(self) -> None:
        """Stop the judgement in the background; the last one stays, and `wanted` stays."""
        if self._background is not None and self._background.cancel():
            self.is_stopped = True

    def close(self) -> bool:
        """End the thread; return whether it has ended."""
        return self._background is None or self._background.close()

    # Without a judgement.

    def move(self, **places: Any) -> None:
        """Replace terrain, start or goal without a judgement, for a page that follows a rover."""
        self.wanted = replace(self.shown.scenario, **places)
        self.shown = replace(self.shown, scenario=self.wanted)

    def replay(
        self,
        prediction: PathPrediction,
        reasons: Sequence[str],
        assumptions: Assumptions | None = None,
    ) -> None:
        """Show a recorded prediction with the recorded reasons (n,) of its waypoints.

        Changed values are judged under the assumptions of the record, where it tells them.
        """
        poses, wanted = prediction.poses, self.wanted
        if assumptions is not None:
            wanted = replace(
                wanted,
                rover=assumptions.change(wanted.rover),
                options=assumptions.change_options(wanted.options),
                arm_angles=assumptions.joint_angles or {},
            )
        start, goal = tuple(poses[0].tolist()), tuple(poses[-1].tolist())
        self.wanted = replace(wanted, start=start, goal=goal, recorded=poses)
        self.shown, self._index = show_recorded(self.wanted, prediction, reasons), 0


def _results(steps: Iterator[Progress | Shown]) -> Iterator[Shown]:
    """Yield what was judged, without what is begun."""
    return (step for step in steps if isinstance(step, Shown))


def _facing(start: Pose | Floats, goal: Pose | Floats) -> Pose:
    """Return the pose at a goal x, y [m] with the yaw of the straight line from start to goal."""
    yaw = np.arctan2(goal[1] - start[1], goal[0] - start[0])
    return float(goal[0]), float(goal[1]), float(yaw)
