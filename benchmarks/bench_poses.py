"""Times a pose on one core: settling, both torque policies, and the necessary look-ups."""

import numba
import numpy as np

from benchmarks.compiled import compiled
from benchmarks.grounds import all_grounds, random_poses, reference_ground
from benchmarks.measure import Figure, median_time, median_times
from rover_physics.contact.settling import settle, settle_from
from rover_physics.prediction.evaluation import (
    AHEAD,
    WORK,
    evaluate,
    new_results,
    new_work,
    set_pose,
)
from rover_physics.prediction.packed_model import PackedModel, pack_model
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.linkage import place
from rover_physics.rover.rover_file import load_rover
from rover_physics.status import PoseStatus
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import find_block_max, height_inside

POSES = 4_000
"""Poses on each ground for the times of a pose."""
FLOOR_POSES = 400
"""Poses on each ground for the look-ups, which are collected in Python."""
LINES = 20
"""Straight paths on each ground for the warm start."""
SPACING = 0.02
"""Distance between poses of a line [m]."""
MARGIN = 0.9
"""Distance between the edge of the ground and the ends of the lines [m]."""
OTHER_POSE = 1e-3
"""Difference in height [m] or angle [rad] above which two poses count as different."""


@compiled
def settle_all(models, poses, works, results):
    """Settle the rover at poses (n, 3), without forces or limits."""
    for i in range(len(poses)):
        set_pose(models[0], poses, AHEAD, i, works[0])
        results[i].status = settle(models[0], works[0])
        results[i].q[:] = works[0].q


@compiled
def settle_along(models, poses, works, results):
    """Settle the rover at poses (n, 3) of a path, each starting from the result before it."""
    for i in range(len(poses)):
        set_pose(models[0], poses, AHEAD, i, works[0])
        if i > 0 and results[i - 1].status == PoseStatus.SETTLED:
            results[i].status = settle_from(models[0], works[0])
        else:
            results[i].status = settle(models[0], works[0])
        results[i].q[:] = works[0].q


@compiled
def look_up_all(grounds, cells):
    """Return the largest height at `cells` (n, 2) [m]."""
    ground, highest = grounds[0], -np.inf
    for k in range(len(cells)):
        highest = max(highest, height_inside(ground, cells[k, 0], cells[k, 1]))
    return highest


def run_settling(model: PackedModel, poses: np.ndarray, kernel=settle_all) -> np.ndarray:
    """Settle at all poses and return the results."""
    works, results = np.full(1, new_work(), WORK), new_results(len(poses))
    kernel(model.records, poses, works, results)
    return results


def cells_looked_up(model: PackedModel, poses: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the cells (n, 2) whose heights are needed to verify contact, and the settled poses.

    For each wheel these are the rim samples that are not above the highest ground around the
    wheel. Any algorithm that finds the pose must read these heights at least once. The second
    value is the number of settled poses.
    """
    results = evaluate(model.records, poses)
    ground, samples = model.record.ground, model.record.samples
    corner = np.array([ground.x0, ground.y0])
    sines, cosines = samples.sines[: samples.rows], samples.cosines[: samples.rows]
    laterals, radius = samples.laterals[: samples.circles], samples.radius
    scale = ground.inverse_resolution
    cells = []
    settled = results[results["status"] == PoseStatus.SETTLED]
    work = new_work()
    for i in np.flatnonzero(results["status"] == PoseStatus.SETTLED):
        place(model.record.linkage, poses[i], results[i].q, work.placement)
        placed = work.placement
        for wheel, centre in enumerate(placed.centres):
            forward, up = placed.forward[wheel], placed.up[wheel]
            rim = radius * (sines[:, None] * forward - cosines[:, None] * up)
            points = centre + rim[:, None] + laterals[:, None] * placed.axis[wheel]
            at = (points[..., :2] - corner) * scale
            middle, reach = (centre[:2] - corner) * scale, samples.reach * scale
            block_max = find_block_max(ground, middle[0], middle[1], reach, reach)
            if np.isfinite(block_max):
                cells.append(at[points[..., 2] <= block_max])
    return np.concatenate(cells), len(settled)


def measure() -> list[Figure]:
    """Measure settling, full evaluation and the necessary look-ups."""
    numba.set_num_threads(1)
    rover = load_rover("lsr1")
    figures = []
    for name, ground in all_grounds().items():
        poses = random_poses(ground, POSES)
        equal, optimal = (
            pack_model(rover, ground, SweepOptions(policy=p)) for p in ("equal", "optimal")
        )
        times = {
            "settling": median_time(lambda: run_settling(equal, poses)),  # noqa: B023
            "equal": median_time(lambda: evaluate(equal.records, poses)),  # noqa: B023
            "optimal": median_time(lambda: evaluate(optimal.records, poses)),  # noqa: B023
        }
        pose = {key: value / POSES * 1e6 for key, value in times.items()}
        figures += [
            Figure("pose", f"{name}: settling alone", pose["settling"], "us", 4.0),
            Figure("pose", f"{name}: full, equal torques", pose["equal"], "us", 8.0),
            Figure(
                "pose",
                f"{name}: what optimal torques add",
                pose["optimal"] - pose["equal"],
                "us",
                100.0,
            ),
        ]
    return figures + measure_warm_start(rover) + measure_floor(rover)


def measure_warm_start(rover) -> list[Figure]:
    """Compare a cold start with a warm start from the neighbouring pose, on lines of poses."""
    figures = []
    for name in ("flat", "rocks", "fractal"):
        ground = reference_ground(name)
        model, lines = pack_model(rover, ground), lines_of_poses(ground)

        def settle_with(kernel, model=model, lines=lines) -> np.ndarray:
            return np.concatenate([run_settling(model, poses, kernel) for poses in lines])

        cold, warm = median_times(
            [lambda: settle_with(settle_all), lambda: settle_with(settle_along)]
        )
        rest, neighbour = settle_with(settle_all), settle_with(settle_along)
        both = (rest["status"] == PoseStatus.SETTLED) & (neighbour["status"] == PoseStatus.SETTLED)
        moved = np.abs(rest["q"] - neighbour["q"]).max(axis=1)[both] > OTHER_POSE
        figures += [
            Figure("warm", f"{name}: from the neighbour", warm / cold, "x", against="from rest"),
            Figure("warm", f"{name}: another pose", 1e3 * moved.mean(), "in 1000", repeats=1),
        ]
    return figures


def lines_of_poses(ground: Terrain) -> list[np.ndarray]:
    """Return straight paths across a ground, with poses every SPACING."""
    low, high = ground.bounds[0] + MARGIN, ground.bounds[1] - MARGIN
    x = np.arange(low, high, SPACING)
    return [
        np.column_stack([x, np.full(len(x), y), np.zeros(len(x))])
        for y in np.linspace(ground.bounds[2] + MARGIN, ground.bounds[3] - MARGIN, LINES)
    ]


def measure_floor(rover) -> list[Figure]:
    """Compare a full evaluation with the look-ups that every algorithm needs."""
    figures = []
    for name in ("flat", "rocks"):
        model = pack_model(rover, reference_ground(name))
        poses = random_poses(reference_ground(name), FLOOR_POSES)
        cells, settled = cells_looked_up(model, poses)
        floor = median_time(lambda: look_up_all(model.ground.records, cells), 21)  # noqa: B023
        full = median_time(lambda: evaluate(model.records, poses), 21)  # noqa: B023
        figures += [
            Figure("floor", f"{name}: look-ups per pose", len(cells) / settled, ""),
            Figure("floor", f"{name}: time of the look-ups", floor / settled * 1e6, "us"),
            Figure("floor", f"{name}: full evaluation / look-ups", full / floor, "x", 4.0),
        ]
    return figures
