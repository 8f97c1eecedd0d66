"""Scenarios that take seconds to judge: a lowered reef in cells of 1 cm, with close waypoints."""

from dataclasses import replace

from benchmarks.grounds import made_reef
from rover_physics.terrain.grid import Terrain
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.viewer.state.scenario import Scenario
from support.viewer_sessions import LSR1

SHARE = 0.2
"""Heights over those of the made reef, on which every path ends after a few centimetres."""
START, GOAL = (-1.5, 0.0, 0.0), (1.5, 0.0, 0.0)


def lowered_reef() -> Terrain:
    """Return the made reef with lower heights, so that paths do not end at once."""
    reef = made_reef()
    return Terrain(SHARE * reef.elevation, reef.resolution, reef.origin)


def tolerant_rover():
    """Return an LSR-1 that hardly slips and whose limits are wide, so that its paths are long."""
    limits = replace(
        LSR1.limits,
        tilt=1.4,
        tip_over_ratio=0.01,
        belly_clearance=0.001,
        wheel_drop=5.0,
    )
    wheel = replace(LSR1.wheel, max_torque=100.0)
    return replace(LSR1, friction=2.0, wheel=wheel, limits=limits)


def slow_options(count: int = 3, waypoint_spacing: float = 2e-4) -> PathQueryOptions:
    """Return options for candidates with so many waypoints that they take seconds."""
    return PathQueryOptions(count=count, spacing=0.2, waypoint_spacing=waypoint_spacing)


def slow_scenario(friction: float = 2.0) -> Scenario:
    """Return a scenario that takes seconds, with a friction coefficient."""
    rover = replace(tolerant_rover(), friction=friction)
    return Scenario(rover, rover, lowered_reef(), START, GOAL, slow_options(), {})
