# SPDX-License-Identifier: Apache-2.0
"""Colours the ground, in a thread: a layer that is predicted for the rover takes seconds."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.documents.legend import describe_scale, describe_survey
from rover_planner.viewer.scene.glb import write_glb
from rover_planner.viewer.scene.ground_mesh import build_ground_mesh, build_survey_mesh
from rover_planner.viewer.state.background_work import Progress
from rover_planner.viewer.state.layers import Colouring
from rover_planner.viewer.state.survey_layers import ShownSurvey


@dataclass(frozen=True, eq=False)
class PaintRequest:
    """Ground and layer to draw."""

    rover: Rover
    """The rover, for layers that are predicted."""
    terrain: Terrain
    """The ground."""
    colouring: Colouring
    """The layer."""
    origin: Floats
    """(3,) origin of the scene [m], map frame."""
    options: SweepOptions = DEFAULT_OPTIONS
    """Options of the model for predicted layers."""
    path: Floats | None = None
    """(n, 3) poses whose yaw the rover has if predicted layers are for the path."""
    survey: ShownSurvey | None = None
    """The survey; None if there is none."""


@dataclass(frozen=True, eq=False)
class PaintedGround:
    """The ground, ready to be sent."""

    glb: bytes
    """The ground as a file for the scene."""
    legend: dict[str, Any]
    """What its colours mean."""


def paint(request: PaintRequest) -> Iterator[Progress | PaintedGround]:
    """Yield what is begun, and the painted ground."""
    yield Progress("ground")
    how, survey, options = request.colouring, request.survey, request.options
    if survey is not None and how.layer in survey.names:
        mesh, meaning = build_survey_mesh(request.terrain, survey, how.layer)
        differences = survey.find_differences(request.rover, options)
        words = survey.describe(how.layer)
        legend = describe_survey(how.layer, words, meaning, differences)
    else:
        along = request.path if how.along else None
        heading = float(np.radians(how.heading)) if along is None else along
        drawn = build_ground_mesh(request.rover, request.terrain, how.layer, heading, options)
        mesh, legend = drawn.mesh, describe_scale(how, drawn.scale)
    yield PaintedGround(write_glb(mesh, request.origin), legend)
