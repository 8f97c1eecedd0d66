# SPDX-License-Identifier: Apache-2.0
"""The subject of the page: rover, map, soil, torques and mode."""

from rover_physics.names import EQUAL, OPTIMAL, SERVO
from rover_physics.terrain.grid import Terrain
from rover_planner.viewer.state.scenario import Scenario

POLICY_TITLES = {EQUAL: "equal torques", SERVO: "speed servos", OPTIMAL: "traction control"}
"""Names of the torque policies on the page."""


def name_ground(terrain: Terrain) -> str:
    """Return a name, by its size, for a ground that has none."""
    x_low, x_high, y_low, y_high = terrain.bounds
    return f"{x_high - x_low:.3g} x {y_high - y_low:.3g} m"


def describe_subject(scenario: Scenario, ground: str) -> dict[str, str]:
    """Return what a scenario is about, by name, on a ground with a name."""
    rover, terrain, options = scenario.rover, scenario.terrain, scenario.options
    soil = options.model.soil or f"firm, friction {rover.friction:g}"
    if terrain.soil_names:
        soil = f"{', '.join(terrain.soil_names)} on the map"
    return {
        "rover": rover.name + ("" if rover == scenario.loaded else " (changed)"),
        "map": ground,
        "soil": soil,
        "torques": POLICY_TITLES[options.model.policy],
        "mode": "planning" if scenario.recorded is None else "replay",
    }
