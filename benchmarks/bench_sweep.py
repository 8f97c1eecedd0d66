"""Time of one full evaluation of the model per pose, on one core: `make bench`.

The target is 15 microseconds a pose under equal torques on the reference's rocks. Times hold for a
quiet machine: beside them stands what a plain Python loop takes, to tell a busy one.
"""

import json
import statistics
import time
from pathlib import Path

import numba
import numpy as np
from rich.console import Console
from rich.table import Table

from rover_physics.rover import Rover, load_rover
from rover_physics.sweep import POLICIES, sweep_path, warm_up
from rover_physics.terrain import Terrain
from rover_planner.mars_terrain import make_mars_terrain

REFERENCE = Path(__file__).resolve().parents[1] / "test" / "data" / "settled_a.npz"
POSES = 4_000
REPEATS = 7
MARGIN = 0.8
"""Distance of the poses from the map's edge [m]."""


def reference_ground(name: str) -> Terrain:
    """Return a ground of the reference cases, 6 x 6 m at 2 cm."""
    with np.load(REFERENCE) as entries:
        meta = json.loads(str(entries["meta"]))
        return Terrain(entries[f"terrain_{name}"], meta["res"], tuple(meta["origin"]))


def random_poses(ground: Terrain) -> np.ndarray:
    """Return poses anywhere on the ground, all headings."""
    rng = np.random.default_rng(0)
    xmin, xmax, ymin, ymax = ground.bounds
    low, high = (xmin + MARGIN, ymin + MARGIN), (xmax - MARGIN, ymax - MARGIN)
    places = rng.uniform(low, high, (POSES, 2))
    return np.column_stack([places, rng.uniform(-np.pi, np.pi, POSES)])


def straight_paths(ground: Terrain) -> np.ndarray:
    """Return poses along straight paths, 2 cm apart, as the planner asks for them."""
    xmin, xmax, ymin, ymax = ground.bounds
    along = np.arange(xmin + MARGIN, xmax - MARGIN, 0.02)
    across = np.linspace(ymin + MARGIN, ymax - MARGIN, max(2, POSES // len(along)))
    y, x = np.meshgrid(across, along, indexing="ij")
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def measure(
    rover: Rover, ground: Terrain, poses: np.ndarray, policy: str
) -> tuple[float, float, float]:
    """Return median and least time per pose [us], and the share of poses that settled."""
    settled = sweep_path(rover, ground, poses, policy=policy).settled.mean()
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        sweep_path(rover, ground, poses, policy=policy)
        times.append((time.perf_counter() - start) / len(poses) * 1e6)
    return statistics.median(times), min(times), float(settled)


def python_loop() -> float:
    """Return the time of a plain Python loop per step [ns]: how fast the machine is just now."""
    start = time.perf_counter()
    total = 0
    for k in range(2_000_000):
        total += k
    return (time.perf_counter() - start) / 2_000_000 * 1e9


def main() -> None:
    """Measure and print a table."""
    numba.set_num_threads(1)
    console = Console()
    with console.status("loading the kernels"):
        warm_up()
    rover = load_rover("lsr1")
    rocks, flat = reference_ground("rocks"), reference_ground("flat")
    mars = make_mars_terrain(1)
    cases = [
        ("rocks, anywhere", rocks, random_poses(rocks)),
        ("rocks, along paths", rocks, straight_paths(rocks)),
        ("flat, anywhere", flat, random_poses(flat)),
        ("Mars, anywhere", mars, random_poses(mars)),
        ("Mars, along paths", mars, straight_paths(mars)),
    ]
    table = Table(title=f"One full evaluation of {rover.name}, one core")
    for heading in ("ground and poses", "policy"):
        table.add_column(heading)
    for heading in ("median [us]", "least [us]", "settled [%]", "Python loop [ns]"):
        table.add_column(heading, justify="right")
    for label, ground, poses in cases:
        for policy in POLICIES:
            with console.status(f"{label}, {policy}"):
                median, least, settled = measure(rover, ground, poses, policy)
            numbers = f"{median:.1f}", f"{least:.1f}", f"{100 * settled:.3f}"
            table.add_row(label, policy, *numbers, f"{python_loop():.0f}")
    console.print(table)


if __name__ == "__main__":
    main()
