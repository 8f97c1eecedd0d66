# SPDX-License-Identifier: Apache-2.0
"""The terrain as a mesh with a layer of a survey as its texture."""

from dataclasses import dataclass

import numpy as np
import trimesh

from rover_physics.numerics.arrays import Floats
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.ground_mesh import (
    build_textured_mesh,
    count_pixels,
    draw_grid_lines,
    shade_hills,
    subsample,
)
from rover_planner.viewer.state.survey_layers import ColouredGround, ShownSurvey


@dataclass(frozen=True, eq=False)
class SurveyMesh:
    """The ground as it is drawn."""

    mesh: trimesh.Trimesh
    """The surface with its texture."""
    meaning: ColouredGround
    """What its colours mean."""


def build_survey_mesh(terrain: Terrain, survey: ShownSurvey, name: str) -> SurveyMesh:
    """Return the ground in the colours of a survey's layer, without unknown cells.

    The texture is finer than the mesh, so that each pixel has the colour of a surveyed cell.

    Args:
        terrain: The ground.
        survey: The survey.
        name: One of its layers.
    """
    x, y, heights = subsample(terrain)
    factor = count_pixels(heights)
    fine_x, fine_y = _refine(x, factor), _refine(y, factor)
    meaning = survey.colour(name, fine_x, fine_y)
    fine = terrain.elevation_at(fine_x, fine_y[:, None])
    texture = draw_grid_lines(shade_hills(meaning.colours, fine_x, fine_y, fine), x, y)
    return SurveyMesh(build_textured_mesh(x, y, heights, texture), meaning)


def _refine(at: Floats, factor: int) -> Floats:
    """Return the middles of pixels, `factor` for each place (n,) [m]."""
    step = at[1] - at[0]
    return at[0] + step * ((np.arange(factor * len(at)) + 0.5) / factor - 0.5)
