# SPDX-License-Identifier: Apache-2.0
"""The state behind the page: what visitors want judged, and what was judged last."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np

from rover_physics.errors import RoverError
from rover_physics.files.validation import Key
from rover_physics.numerics.arrays import Floats
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.planning.path_query import Assumptions
from rover_planner.planning.search.edge_memory import EdgeMemory
from rover_planner.studies.rover_values import vary
from rover_planner.viewer.state.judging import Step, judge_steps, show_recorded
from rover_planner.viewer.state.scenario import Pose, Scenario, Shown

REFUSALS = (RoverError, PlanningError)
"""Errors that say what is wrong with a request."""
MAX_STEPS = 50
"""Most changes that can be undone."""


class ViewSession:
    """The scenario that is wanted and what is shown: frozen values that are replaced as a whole.

    Its owner judges, perhaps in another thread. All changes belong to one thread, the owner's. A
    refused change alters nothing but `refusal`. The path that is looked at stays until
    `show_path`, another goal or another rover.
    """

    judge: Callable[[Iterator[Step]], object]
    """Takes steps, and has `take` called with all that they find; the owner sets it."""

    def __init__(self, wanted: Scenario):
        """Plan from start to goal; no path around obstacles is searched yet.

        Raises:
            RoverError, PlanningError: The rover, the poses or the options are invalid.
        """
        self.wanted = wanted
        """The scenario that visitors want judged."""
        self.kept: Scenario | None = None
        """The values that were kept as reference; None: the rover as it was loaded."""
        self.refusal = ""
        """Reason why the last change was refused, empty if it was not."""
        self.is_stopped = False
        """True if the judgement of `wanted` was cancelled or failed."""
        self._undo: list[Scenario] = []
        self.find_steps = partial(judge_steps, memory=EdgeMemory())
        """Finds what is shown, as `judge_steps` does."""
        self._asked = self.find_steps(self.wanted)
        """The newest steps."""
        found = (step for step in self._asked if isinstance(step, Shown))
        *_, self.shown = islice(found, 2)  # and not what it searches
        """The last finding."""
        self._index = self.shown.index
        """Index of the path that visitors want to look at."""

    @property
    def is_outdated(self) -> bool:
        """True if the shown verdict is of other values than those that are wanted."""
        return self.shown.scenario is not self.wanted

    @property
    def is_complete(self) -> bool:
        """True if all paths were judged for what is wanted."""
        return not self.is_outdated and not self.shown.old

    # What is wanted. A change may be accepted, and refused when it is judged; `refusal` then says
    # why.

    def show_path(self, index: int) -> None:
        """Look at another path.

        Raises:
            PlanningError: There is no path of this index, or other paths are wanted.
        """
        count = len(self.shown.paths)
        if not 0 <= index < count:
            raise PlanningError(f"no path {index + 1}; there are paths 1 to {count}")
        if not self.wanted.has_paths_of(self.shown.scenario):
            raise PlanningError("the listed paths are old; wait for the new ones")
        self.ask(index=index)

    def plan_to(self, goal: Pose | Floats, start: Floats | None = None) -> None:
        """Plan to a goal x, y [m] with the straight line's yaw, perhaps from a start (2,) [m]."""
        (x, y), before = goal[:2], self.wanted.start if start is None else start
        yaw = float(np.arctan2(y - before[1], x - before[0]))
        begin = self.wanted.start if start is None else (float(start[0]), float(start[1]), yaw)
        self.ask(replace(self.wanted, start=begin, goal=(float(x), float(y), yaw), recorded=None))

    def change_rover(self, keys: Sequence[Key], value: float) -> None:
        """Change a number of the rover, the same at all of the keys in the rover file.

        Raises:
            RoverError: The changed rover is invalid.
        """
        rover = vary(self.wanted.rover, dict.fromkeys(keys, value))
        self.take_change(replace(self.wanted, rover=rover))

    def undo(self) -> None:
        """Take the numbers of the rover before the last change.

        Raises:
            PlanningError: There is no change to undo.
        """
        if not self._undo:
            raise PlanningError("there is no change of this rover to undo")
        self.ask(self.wanted.take_values(self._undo.pop()))

    def keep_reference(self, values: Scenario | None) -> None:
        """Compare with some values from now on; None: with the rover as it was loaded."""
        self.kept = values
        self.ask()

    def take_rover(self, rover: Rover) -> None:
        """Take another rover as it was loaded, and plan again."""
        self.take_scenario(replace(self.wanted, loaded=rover).as_loaded())

    def take_scenario(self, scenario: Scenario) -> None:
        """Plan for a whole scenario on the same ground."""
        if scenario.loaded is not self.wanted.loaded:
            self.kept, self._undo = None, []
        self.ask(scenario)

    def take_change(self, scenario: Scenario) -> None:
        """Take other values, and perhaps a path of its own; one step to undo."""
        if self.is_complete:
            self._undo = [*self._undo[-MAX_STEPS:], self.wanted]
        self.ask(scenario)

    def ask(self, wanted: Scenario | None = None, index: int | None = None) -> None:
        """Judge a scenario, and look at a path by its index; each is by default as before."""
        wanted = wanted or self.wanted
        same = wanted.has_paths_of(self.shown.scenario)
        if index is not None:
            self._index = index
        self.wanted, self.refusal, self.is_stopped = wanted, "", False
        before, at = (self.shown, self._index) if same else (None, None)
        self._asked = self.find_steps(wanted, before, at, self.kept)
        self.judge(self._asked)

    def take(self, steps: Iterator[Step], found: Shown | BaseException) -> None:
        """Take what was judged, unless visitors look at another path meanwhile.

        Args:
            steps: The steps that have found it.
            found: What is shown, or the error that ended the judgement. After a refusal, what was
                judged last is wanted again.

        Raises:
            Exception: The newest judgement failed by an error that is no refusal.
        """
        is_newest = steps is self._asked
        if isinstance(found, Shown):
            same = found.index == self._index and found.scenario.has_paths_of(self.wanted)
            if is_newest or same:
                self.shown, self._index = found, found.index
        elif is_newest and isinstance(found, REFUSALS):
            self._index = self.shown.index
            self.ask(self.shown.scenario)  # also what was left of it
            self.refusal = str(found)
        elif is_newest:
            self.is_stopped = True
            raise found

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
            ).change_options(joint_angles=assumptions.joint_angles)
        start, goal = tuple(poses[0].tolist()), tuple(poses[-1].tolist())
        self.wanted = self.kept = replace(wanted, start=start, goal=goal, recorded=poses)
        self.shown, self._index = show_recorded(self.wanted, prediction, reasons), 0
