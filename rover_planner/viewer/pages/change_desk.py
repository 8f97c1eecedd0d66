# SPDX-License-Identifier: Apache-2.0
"""Compares the rover and its drive with those before a change, and takes changes back."""

from collections.abc import Callable, Mapping

from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.viewer.panel.tabs.rover_tab import RoverTab
from rover_planner.viewer.state.reasons.before_after import (
    ChangeHistory,
    compare_drives,
    list_changes,
)
from rover_planner.viewer.state.session import ViewSession
from rover_planner.viewer.state.trajectory import Trajectory


class ChangeDesk:
    """The history of the rover and what the tab of the rover shows of it."""

    def __init__(self, session: ViewSession, tab: RoverTab, changed: Callable[[], None]):
        """Begin with the judgement of a session.

        Args:
            session: The session.
            tab: The tab of the rover.
            changed: Called after a change was taken back.
        """
        self._session, self._tab, self._changed = session, tab, changed
        self._history = ChangeHistory(session.shown)

    def take_judged(self) -> None:
        """Note what the session has judged last."""
        self._history.take(self._session.shown)

    @property
    def before(self) -> Trajectory | None:
        """The drive of the rover before along the shown path; None if there is none."""
        judgement = self._history.reference_for(self._session.shown)
        return None if judgement is None else judgement.trajectory

    def show(self) -> None:
        """Show what has changed of the rover and of its drive."""
        now, before = self._session.shown, self.before
        changed = list_changes(now.scenario.loaded, now.scenario.rover)
        differences = () if before is None else compare_drives(before, now.trajectory)
        self._tab.show_changes(changed, differences)

    def undo(self) -> None:
        """Take the last rover again.

        Raises:
            PlanningError: There is none.
        """
        judgement = self._history.undo(self._session.wanted)
        if judgement is None:
            raise PlanningError("there is no change of this rover on these paths to undo")
        self._take_back(judgement.scenario.rover, judgement.scenario.arm_angles)

    def reset(self) -> None:
        """Take the rover as it was loaded."""
        self._take_back(self._session.wanted.loaded, {})

    def _take_back(self, rover: Rover, arm_angles: Mapping[str, float]) -> None:
        self._session.restore_rover(rover, arm_angles)
        self._changed()
