# SPDX-License-Identifier: Apache-2.0
"""Colours the ground in the background: a layer that is predicted for the rover takes seconds."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.panel.ground_tab import GroundTab
from rover_planner.viewer.panel.legend import draw_survey_legend
from rover_planner.viewer.scene.ground_mesh import (
    build_ground_mesh,
    build_survey_mesh,
    export_ground,
)
from rover_planner.viewer.scene.scene import Scene
from rover_planner.viewer.state.background_work import BackgroundWork, Progress
from rover_planner.viewer.state.colours import ColourScale
from rover_planner.viewer.state.scenario import Scenario
from rover_planner.viewer.state.survey_layers import ColouredGround, ShownSurvey


@dataclass(frozen=True, eq=False)
class PaintRequest:
    """Ground and layer to draw."""

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

    glb: bytes
    """The ground as a file for the scene."""
    scale: ColourScale | ColouredGround
    """The values of its colours; the latter for a layer of a survey."""


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
                self._explain(one.request, one.result.scale)

    def _explain(self, request: PaintRequest, scale: ColourScale | ColouredGround) -> None:
        """Show what the colours mean."""
        if isinstance(scale, ColourScale):
            self._tab.show_scale(scale)
        elif request.survey is not None:
            survey, asked, name = request.survey, request.scenario, request.layer
            differences = survey.find_differences(asked.rover, asked.asked_options.model)
            description = survey.describe(name)
            self._tab.show_legend(draw_survey_legend(name, description, scale, differences))


def _paint(request: PaintRequest) -> Iterator[Progress | PaintedGround]:
    yield Progress("colouring the ground", 1, 1)
    asked, name = request.scenario, request.layer
    if request.survey is not None:
        mesh, meaning = build_survey_mesh(asked.terrain, request.survey, name)
        yield PaintedGround(export_ground(mesh, request.origin), meaning)
    else:
        options = asked.asked_options.model
        drawn = build_ground_mesh(asked.rover, asked.terrain, name, request.heading, options)
        yield PaintedGround(export_ground(drawn.mesh, request.origin), drawn.scale)
