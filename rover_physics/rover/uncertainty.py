# SPDX-License-Identifier: Apache-2.0
"""Standard deviations of what is not known exactly of a rover, its pose and its ground."""

from dataclasses import dataclass
from typing import Annotated

from rover_physics.files.rules import number
from rover_physics.numerics.plausible import MAX_MASS

ACCEPTED_CHANCE = 0.05
"""Largest chance of failure of a traversable path if none is told: one drive of twenty."""
SIGMAS = 3.0
"""Number of standard deviations by which a map's heights may be wrong if none is told."""
MAX_DEVIATION = 0.35
"""Largest standard deviation over the value: about three of them leave it above 0."""
Relative = Annotated[float, number("", least=0.0, most=MAX_DEVIATION)]
Metres = Annotated[float, number("m", least=0.0, most=1.0)]


@dataclass(frozen=True)
class Uncertainty:
    """Standard deviations, each of an independent normal distribution about what is told.

    Those of heights are the map's own (`elevation_std`).
    """

    friction: Relative = 0.10
    """Friction, common to all wheels: what repeated pull tests on one kind of ground scatter."""
    friction_per_wheel: Relative = 0.05
    """Friction under each wheel beside that: assumed, half of it."""
    max_torque: Relative = 0.05
    """Torque limit, common to all wheels: supply voltage and temperature of the motors."""
    max_torque_per_wheel: Relative = 0.03
    """Torque limit of each wheel beside that: the scatter of gears and motors of one type."""
    wheel_radius: Relative = 0.01
    """Radius of all wheels: a millimetre of wear or sinkage of a wheel of 0.1 m."""
    mass: Annotated[float, number("kg", least=0.0, most=MAX_MASS)] = 0.0
    """Mass of the body with its payload in [kg]: it is weighed."""
    com: Metres = 0.005
    """Centre of mass of the body along each axis in [m]: as of a weighing on three scales."""
    position: Metres = 0.02
    """Position along and across the path in [m]: a cell of the map."""
    heading: Annotated[float, number("rad", least=0.0, most=0.5)] = 0.01
    """Heading in [rad]: half a degree, as of a gyro compass."""
    model: Relative = 0.10
    """The model's own error: the forces that are needed over those that it finds, common to a
    path; calibrated by `python -m benchmarks.chance` (docs/validation.md)."""
