"""Times a new verdict of the page after a change of the rover: 10 m, 501 waypoints."""

import time

from benchmarks.measure import Figure, median_time
from rover_physics.rover.rover_file import load_rover
from rover_planner.viewer.state.session import ViewSession
from rover_planner.worlds.mars_terrain import make_mars_terrain


def measure() -> list[Figure]:
    """Measure the new verdict after changes of friction and of wheel radius."""
    ground = make_mars_terrain(1, 24.0, 0.05)
    session = ViewSession(load_rover("lsr1"), ground, (-5.0, -6.0, 0.0), (5.0, -6.0, 0.0))
    values = iter([0.6, 0.8] * 100)

    def change() -> None:
        assert session.change_rover([("friction",)], next(values))

    def radius() -> None:
        assert session.change_rover([("wheel", "radius")], 0.1 + 0.01 * (next(values) - 0.6))

    clock = time.perf_counter
    return [
        Figure("view", "friction changed: path judged again", 1e3 * median_time(change, 11, clock),
               "ms", 200.0, repeats=11),
        Figure("view", "wheel radius changed: the same", 1e3 * median_time(radius, 11, clock),
               "ms", 200.0, repeats=11),
        Figure("view", "all five candidates", 1e3 * median_time(session.plan_again, 11, clock),
               "ms", repeats=11),
    ]  # fmt: skip
