# SPDX-License-Identifier: Apache-2.0
"""The tab of the studies: choose one, run it, see its picture, take over the best rover."""

import html
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.files.validation import errors_of
from rover_physics.files.yaml_file import parse_yaml
from rover_planner.studies.study_file import Study, find_examples, load_study, study_from_dict
from rover_planner.viewer.state.visitor_requests import Action


@dataclass(frozen=True)
class StudyActions:
    """What the controls of the tab do."""

    choose: Callable[[Callable[[], Study]], None]
    """Chooses the study that a function reads."""
    run: Action
    """Runs the chosen study."""
    cancel: Action
    """Stops it."""
    take_best: Action
    """Shows the best rover on the page."""


class StudiesTab:
    """Question, progress, result and picture of a study."""

    def __init__(self, gui: Any, actions: StudyActions):
        """Add the contents to the tab that is open."""
        self._gui, self._actions = gui, actions
        self._examples: dict[str, Path] = find_examples()
        chosen = gui.add_dropdown("Study", tuple(self._examples) or ("none",))
        chosen.on_update(lambda event: self._choose_example(event.target.value))
        upload = gui.add_upload_button("Load a study file", mime_type=".yaml,.yml")
        upload.on_upload(lambda event: self._choose_file(event.target.value))
        self._question = gui.add_html("")
        self._run = gui.add_button("Run the study")
        self._run.on_click(lambda _event: actions.run())
        self._progress = gui.add_html("")
        self._bar = gui.add_progress_bar(0.0, visible=False)
        self._cancel = gui.add_button("Cancel the study", visible=False)
        self._cancel.on_click(lambda _event: actions.cancel())
        self._answer = gui.add_html("")
        self._picture: Any = None
        self._take = gui.add_button("Show the best rover", visible=False)
        self._take.on_click(lambda _event: actions.take_best())
        if self._examples:
            self._choose_example(next(iter(self._examples)))

    def _choose_example(self, name: str) -> None:
        if name in self._examples:
            self._actions.choose(lambda: load_study(self._examples[name]))

    def _choose_file(self, file: Any) -> None:
        def read() -> Study:
            with errors_of(file.name):
                data = parse_yaml(file.content.decode("utf-8", "replace"))
            return study_from_dict(data, file.name)

        self._actions.choose(read)

    def show_question(self, lines: Sequence[str]) -> None:
        """Show what the chosen study asks."""
        self._question.content = _as_text("study-question", lines)

    def show_progress(self, words: str, share: float | None) -> None:
        """Show how far the study is in words, and its share of 0 to 1; None if none runs."""
        runs = share is not None
        self._progress.content = _as_text("study-progress", [words]) if words else ""
        self._bar.value = 100.0 * (share or 0.0)
        self._bar.visible = self._cancel.visible = runs
        self._run.disabled = runs

    def show_result(self, lines: Sequence[str], picture: NDArray[np.uint8]) -> None:
        """Show the result in words and its picture (height, width, 4)."""
        self._answer.content = _as_text("study-answer", lines)
        if self._picture is None:
            self._picture = self._gui.add_image(picture, format="png")
        self._picture.image = picture
        self._picture.visible = self._take.visible = True

    def hide_result(self) -> None:
        """Remove a result from sight."""
        self._answer.content = ""
        self._take.visible = False
        if self._picture is not None:
            self._picture.visible = False


def _as_text(name: str, lines: Sequence[str]) -> str:
    text = html.escape("\n".join(lines))
    style = "white-space:pre-wrap;font-size:12px;margin:4px 8px"
    return f'<div id="{name}" style="{style}">{text}</div>'
