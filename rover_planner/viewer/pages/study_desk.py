# SPDX-License-Identifier: Apache-2.0
"""Runs studies for the page: the chosen one in the background, its result into the tab."""

from collections.abc import Callable
from typing import Any

from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError
from rover_planner.studies.runner import find_rover
from rover_planner.studies.study_file import Study
from rover_planner.studies.summary import describe_question
from rover_planner.viewer.panel.tabs.studies_tab import StudiesTab, StudyActions
from rover_planner.viewer.state.background_work import BackgroundWork
from rover_planner.viewer.state.study_work import FinishedStudy, run_in_background
from rover_planner.viewer.state.visitor_requests import VisitorRequests


class StudyDesk:
    """The tab of the studies and the work behind it; the page's thread calls all methods."""

    def __init__(
        self, gui: Any, requests: VisitorRequests, show_rover: Callable[[Rover, Rover], None]
    ):
        """Add the tab's contents to the tab that is open.

        Args:
            gui: The GUI of viser.
            requests: Takes what visitors want.
            show_rover: Shows a rover on the page as changed from another.
        """
        self._show_rover = show_rover
        self._study: Study | None = None
        self._finished: FinishedStudy | None = None
        self._told = ("", 0.0)
        """The progress as it is shown."""
        add = requests.add
        self.work: BackgroundWork[Study, FinishedStudy] = BackgroundWork(
            run_in_background, lambda: add(self._take_finished, "study finished"), "study"
        )
        self._tab = StudiesTab(
            gui,
            StudyActions(
                choose=lambda read: add(lambda: self._choose(read), "study"),
                run=lambda: add(self._run, "run study"),
                cancel=lambda: add(self._cancel, "cancel study"),
                take_best=lambda: add(self._take_best, "best rover"),
            ),
        )

    def _choose(self, read: Callable[[], Study]) -> None:
        self._cancel()
        self._study = read()
        self._forget()
        self._tab.show_question(describe_question(self._study))

    def _run(self) -> None:
        if self._study is None:
            raise PlanningError("no study is chosen; choose an example or load a study file")
        self._forget()
        self.work.ask(self._study)

    def _forget(self) -> None:
        self._finished = None
        self._tab.hide_result()

    def _cancel(self) -> None:
        if self.work.cancel():
            self._tab.show_progress("cancelled", None)
            self._told = ("cancelled", 0.0)

    def _take_best(self) -> None:
        if self._finished is not None:
            result = self._finished.result
            self._show_rover(find_rover(result.study, result.best), result.study.rover)

    def _take_finished(self) -> None:
        for one in self.work.take():
            if one.error is not None:
                self._tab.show_progress(f"failed: {one.error}", None)
                raise one.error
            if one.result is not None:
                self._finished = one.result
                self._tab.show_result(one.result.lines, one.result.picture)
                self._tab.show_progress("finished", None)

    def show_progress(self) -> None:
        """Show how far the study is, if one runs."""
        progress = self.work.progress
        if progress is None or not progress.steps:
            return
        told = progress.describe(), (progress.step - 1) / progress.steps
        if told != self._told:
            self._told = told
            self._tab.show_progress(*told)
