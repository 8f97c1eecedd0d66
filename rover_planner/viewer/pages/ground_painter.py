# SPDX-License-Identifier: Apache-2.0
"""Colours the ground in the background: a layer that is predicted for the rover takes seconds."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.documents.legend import describe_scale, describe_survey
from rover_planner.viewer.scene.glb import write_glb
from rover_planner.viewer.scene.ground_mesh import (
    build_ground_mesh,
    build_survey_mesh,
)
from rover_planner.viewer.state.background_work import BackgroundWork, Progress
from rover_planner.viewer.state.layers import HEIGHT, LAYERS
from rover_planner.viewer.state.scenario import Scenario
from rover_planner.viewer.state.survey_layers import ShownSurvey


@dataclass(frozen=True)
class Colouring:
    """What the ground is coloured by."""

    layer: str = HEIGHT
    """Name of the layer."""
    heading: float = 0.0
    """Heading of the rover for predicted layers [deg]."""
    along: bool = False
    """True if they are for the heading of the path instead."""

    @property
    def is_predicted(self) -> bool:
        """True if the layer is predicted for the rover."""
        return self.layer in LAYERS and LAYERS[self.layer].is_predicted

    def describe(self) -> str:
        """Return what the colours are of, in words."""
        if not self.is_predicted:
            return self.layer
        at = "along the path" if self.along else f"at heading {self.heading:g} deg"
        return f"{self.layer} {at}"


@dataclass(frozen=True, eq=False)
class PaintRequest:
    """Ground and layer to draw."""

    scenario: Scenario
    """Rover, ground and options."""
    colouring: Colouring
    """The layer."""
    path: Floats
    """(n, 3) poses whose yaw the rover has if predicted layers are for the path."""
    survey: ShownSurvey | None
    """The survey; None if there is none."""
    origin: Floats
    """(3,) origin of the scene [m], map frame."""


@dataclass(frozen=True, eq=False)
class PaintedGround:
    """The ground, ready to be sent."""

    glb: bytes
    """The ground as a file for the scene."""
    legend: dict[str, Any]
    """What its colours mean."""


class GroundPainter:
    """Colours the newest ground that was asked for."""

    def __init__(self, wake: Callable[[], object]):
        """Start the thread; it calls `wake` when there is something to take."""
        self._asked: PaintRequest | None = None
        self.work: BackgroundWork[PaintRequest, PaintedGround] = BackgroundWork(
            _paint, wake, "ground"
        )

    def paint(self, request: PaintRequest) -> None:
        """Begin to colour."""
        self._asked = request
        self.work.ask(request)

    def take(self) -> PaintedGround | None:
        """Return the ground that was asked for last, if it is finished.

        Raises:
            Exception: It failed.
        """
        done = [one for one in self.work.take() if one.request is self._asked]
        for one in done:
            if one.error is not None:
                raise one.error
        return done[-1].result if done else None


def _paint(request: PaintRequest) -> Iterator[Progress | PaintedGround]:
    yield Progress("ground")
    asked, how, survey = request.scenario, request.colouring, request.survey
    options = asked.asked_options.model
    if survey is not None and how.layer in survey.names:
        mesh, meaning = build_survey_mesh(asked.terrain, survey, how.layer)
        differences = survey.find_differences(asked.rover, options)
        words = survey.describe(how.layer)
        legend = describe_survey(how.layer, words, meaning, differences)
    else:
        heading = request.path if how.along else float(np.radians(how.heading))
        drawn = build_ground_mesh(asked.rover, asked.terrain, how.layer, heading, options)
        mesh, legend = drawn.mesh, describe_scale(how.describe(), drawn.scale)
    yield PaintedGround(write_glb(mesh, request.origin), legend)
