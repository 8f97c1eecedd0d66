# SPDX-License-Identifier: Apache-2.0
"""Compiles what a survey needs before its workers start, so that each of them only loads it."""

from dataclasses import replace

import numpy as np

from rover_physics.terrain.grid import Terrain
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.tile_survey import survey_tile


def warm_up_survey(request: SurveyRequest) -> None:
    """Survey one cell of a small ground, so that kernels are compiled and options are checked.

    Raises:
        ModelError, SoilError: As `survey_tile`.
    """
    span = 4.0 * max(x for x, _, _ in map(np.abs, request.rover.suspension.wheels.values()))
    ground = np.zeros((41, 41))
    ground[:, 0] = np.nan
    terrain = Terrain(ground, span / 20.0, (-span, -span))
    survey_tile(replace(request, headings=2), terrain, np.zeros((1, 2)))
