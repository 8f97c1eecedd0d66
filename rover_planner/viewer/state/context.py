# SPDX-License-Identifier: Apache-2.0
"""The subject of the page in words: rover, map, soil, torque policy and mode."""

from dataclasses import dataclass

from rover_physics.names import EQUAL, OPTIMAL, SERVO
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.state.scenario import Scenario

POLICY_TITLES = {EQUAL: "equal torques", SERVO: "speed servos", OPTIMAL: "traction control"}
"""Names of the torque policies on the page."""


@dataclass(frozen=True)
class Context:
    """The subject of the page; empty texts are not shown."""

    rover: str
    """Name of the rover, and whether it was changed."""
    ground: str
    """Name of the map."""
    soil: str
    """Name of the soil."""
    policy: str
    """Title of the torque policy."""
    mode: str
    """Mode of the page, such as "planning"."""


def name_ground(terrain: Terrain) -> str:
    """Return a name, by its size, for a ground that has none."""
    x_low, x_high, y_low, y_high = terrain.bounds
    return f"{x_high - x_low:.3g} x {y_high - y_low:.3g} m"


def describe_scenario(scenario: Scenario, ground: str) -> Context:
    """Return what a scenario is about, on a ground with a name."""
    rover, terrain, options = scenario.rover, scenario.terrain, scenario.options
    changed = "" if rover == scenario.loaded else " (changed)"
    soil = options.model.soil or f"firm, friction {rover.friction:g}"
    if terrain.soil_names:
        soil = f"{', '.join(terrain.soil_names)} on the map"
    mode = "planning" if scenario.recorded is None else "replay"
    policy = POLICY_TITLES[options.model.policy]
    return Context(f"{rover.name}{changed}", ground, soil, policy, mode)
