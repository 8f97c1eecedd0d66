# SPDX-License-Identifier: Apache-2.0
"""Colours the ground in the background: a layer that is predicted for the rover takes seconds."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.sweep_options import SweepOptions
from rover_planner.viewer.panel.survey_legend import draw_survey_legend
from rover_planner.viewer.panel.tabs.ground_tab import GroundTab
from rover_planner.viewer.scene.ground_mesh import GroundMesh, build_ground_mesh, export_ground
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.scene.survey_mesh import SurveyMesh, build_survey_mesh
from rover_planner.viewer.state.background_work import BackgroundWork, Progress
from rover_planner.viewer.state.scenario import Scenario
from rover_planner.viewer.state.survey_layers import ShownSurvey


@dataclass(frozen=True, eq=False)
class PaintRequest:
    """What to draw."""

    scenario: Scenario
    """Rover, ground and options."""
    layer: str
    """Name of the layer."""
    heading: float | Floats
    """Yaw of the rover, where the layer is predicted [rad]; or a path (n, 3) whose yaw at the
    nearest waypoint it has."""
    survey: ShownSurvey | None
    """The survey whose layer it is; None if it is no survey's."""
    origin: Floats
    """(3,) origin of the scene [m], map frame."""


@dataclass(frozen=True, eq=False)
class PaintedGround:
    """The ground, ready to be sent."""

    drawn: GroundMesh | SurveyMesh
    """What is drawn, and what its colours mean."""
    glb: bytes
    """The same as a file for the scene."""


class GroundPainter:
    """Draws the ground in the colours of the layer that the tab names."""

    def __init__(
        self,
        scene: Scene,
        tab: GroundTab,
        wake: Callable[[], object],
        survey: ShownSurvey | None = None,
    ):
        """Start the thread; it calls `wake` when there is something for `show_painted`."""
        self._scene, self._tab, self._survey = scene, tab, survey
        self._asked: PaintRequest | None = None
        self.work: BackgroundWork[PaintRequest, PaintedGround] = BackgroundWork(
            _paint, wake, "ground"
        )

    def paint(self, scenario: Scenario, path: Floats) -> None:
        """Begin to colour the ground for a scenario and its shown path (n, 3)."""
        fixed = float(np.radians(self._tab.heading))
        heading = path if self._tab.is_along_path else fixed
        survey = self._survey if self._tab.is_surveyed else None
        origin = self._scene.frame.origin
        self._asked = PaintRequest(scenario, self._tab.layer, heading, survey, origin)
        self.work.ask(self._asked)

    def show_painted(self) -> None:
        """Show the ground if it is finished.

        Raises:
            Exception: It failed.
        """
        for one in self.work.take():
            if one.request is not self._asked:
                continue
            if one.error is not None:
                raise one.error
            if one.result is not None:
                self._scene.draw_ground(one.result.glb)
                self._explain(one.request, one.result.drawn)

    def _explain(self, request: PaintRequest, drawn: GroundMesh | SurveyMesh) -> None:
        """Show what the colours mean."""
        if isinstance(drawn, GroundMesh):
            self._tab.show_scale(drawn.scale)
        elif request.survey is not None:
            asked, name = request.scenario, request.layer
            differences = request.survey.find_differences(asked.rover, _options_of(asked))
            told = request.survey.describe(name)
            self._tab.show_legend(draw_survey_legend(name, told, drawn.meaning, differences))


def _options_of(asked: Scenario) -> SweepOptions:
    return asked.asked_options.model


def _paint(request: PaintRequest) -> Iterator[Progress | PaintedGround]:
    yield Progress("colouring the ground", 1, 1)
    drawn = _build(request)
    yield PaintedGround(drawn, export_ground(drawn.mesh, request.origin))


def _build(request: PaintRequest) -> GroundMesh | SurveyMesh:
    asked = request.scenario
    if request.survey is not None:
        return build_survey_mesh(asked.terrain, request.survey, request.layer)
    options = _options_of(asked)
    return build_ground_mesh(asked.rover, asked.terrain, request.layer, request.heading, options)
