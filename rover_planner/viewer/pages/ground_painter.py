# SPDX-License-Identifier: Apache-2.0
"""Colours the ground, in a thread: a layer that is predicted for the rover takes seconds."""

from collections.abc import Iterator
from dataclasses import dataclass

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.scene.ground_mesh import write_ground
from rover_planner.viewer.state.background_work import Progress
from rover_planner.viewer.state.ground_grid import make_grid
from rover_planner.viewer.state.layers import Colouring, Legend, colour_ground, colour_limit
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


def paint(request: PaintRequest) -> Iterator[Progress | tuple[bytes, Legend]]:
    """Yield what is begun, and the painted ground as a file for the scene, with its legend."""
    yield Progress("ground")
    how, rover, terrain, options = (
        request.colouring, request.rover, request.terrain, request.options
    )  # fmt: skip
    grid = make_grid(terrain)
    if request.survey is not None and how.layer in request.survey.names:
        ground = request.survey.colour(how.layer, rover, options, grid)
    elif how.is_predicted:
        ground = colour_limit(how, rover, terrain, request.path, options, grid)
    else:
        ground = colour_ground(how.layer, terrain, grid)
    yield write_ground(grid, ground, request.origin), ground.legend
