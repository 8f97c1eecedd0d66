# SPDX-License-Identifier: Apache-2.0
"""The question of a survey: rover, options, headings and distance of cells."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

import rover_physics
from rover_physics.bounds.path import check_sigmas
from rover_physics.numerics.plain_values import to_plain
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import SIGMAS
from rover_planner.errors import PlanningError

MAX_HEADINGS = 64
"""Largest number of headings: a cell keeps a bit of each."""
MAX_STEP = 10_000
"""Largest distance of surveyed cells [map cells]."""


@dataclass(frozen=True, eq=False)
class SurveyRequest:
    """A question about a whole map.

    Raises:
        PlanningError: A number out of its range.
        ModelError: Sigmas that are no number of standard deviations.
    """

    rover: Rover
    """The rover."""
    options: SweepOptions = DEFAULT_OPTIONS
    """Torque policy, friction and more."""
    headings: int = 16
    """Number of headings, the first along x, then equally spaced to the left."""
    step: int = 1
    """Distance of surveyed cells [map cells]."""
    turns: bool = False
    """True to judge turns on the spot, too."""
    chance: bool = False
    """True to find the chances of failure, too."""
    sigmas: float = SIGMAS
    """Standard deviations to allow for where the map has them."""

    def __post_init__(self) -> None:
        for name, most in (("headings", MAX_HEADINGS), ("step", MAX_STEP)):
            value = getattr(self, name)
            if not 1 <= value <= most:
                raise PlanningError(f"{name} is {value}; it must be 1 to {most}")
        check_sigmas(self.sigmas)

    @property
    def yaws(self) -> np.ndarray:
        """The headings (n,) [rad]."""
        return np.arange(self.headings) * (2.0 * np.pi / self.headings)

    def describe(self, map_hash: str) -> dict[str, Any]:
        """Return all that the result depends on, as JSON types.

        Args:
            map_hash: Hash of the map's content.
        """
        return to_plain(asdict(self)) | {"map": map_hash, "version": rover_physics.__version__}
