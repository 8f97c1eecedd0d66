"""What a rover is worth: utilisation, margin, the tallest step it climbs, even loads."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rover_physics.limits import judge
from rover_physics.rover import Rover
from rover_physics.sweep import sweep_path
from rover_physics.terrain import Terrain, load_terrain
from rover_planner.studies.study_file import Study, StudyDrive

Floats = NDArray[np.float64]
SPACING = 0.02
"""Distance between waypoints [m]."""
STEP_TOLERANCE = 0.002
"""To which the height of a step is found [m]."""
SEARCH_STEP = 0.02
"""Heights of steps that are tried one after another before the last one is bracketed [m]."""


def evaluate(study: Study, rover: Rover) -> float:
    """Return the objective of a study for a rover; NaN where it cannot be told.

    Raises:
        RoverError: A terrain cannot be loaded, or the model refuses an argument.
    """
    if study.objective == "tallest_step":
        return tallest_step(rover, study.policy, study.friction)
    if study.objective == "load_imbalance":
        loads = sweep_path(rover, _flat(rover), np.zeros((1, 3))).wheel_loads[0]
        return float(loads.max() / loads.mean())
    worst = [_worst_on(study, rover, drive) for drive in study.drives]
    return float(np.max(worst) if study.objective == "worst_utilisation" else np.min(worst))


def _worst_on(study: Study, rover: Rover, drive: StudyDrive) -> float:
    path = drive.length * np.linspace(0.0, 1.0, round(drive.length / SPACING) + 1)
    x, y, yaw = drive.start
    poses = np.column_stack(
        [x + path * np.cos(yaw), y + path * np.sin(yaw), np.full_like(path, yaw)]
    )
    prediction = sweep_path(
        rover, _ground(rover, drive), poses, friction=study.friction, policy=study.policy
    )
    verdict = judge(rover, prediction)
    if not prediction.settled.all():
        return float("nan")
    if study.objective == "worst_utilisation":
        return verdict.max_friction_utilisation
    return verdict.min_tip_over_ratio


def _ground(rover: Rover, drive: StudyDrive) -> Terrain:
    if drive.kind == "file":
        return load_terrain(drive.file)
    reach = drive.length + 2.0 * _length(rover) + abs(drive.start[0]) + abs(drive.start[1])
    cell = 0.2 * rover.wheel.radius
    axis = cell * np.arange(-int(reach / cell), int(reach / cell) + 1)
    x = np.broadcast_to(axis, (len(axis), len(axis)))
    if drive.kind == "slope":
        return Terrain(np.tan(drive.size) * x, cell, (axis[0], axis[0]))
    return _step(rover, drive.size)


def _length(rover: Rover) -> float:
    wheels = rover.suspension.wheels
    return wheels["front"][0] - wheels["rear"][0] + 2.0 * rover.wheel.radius


def _flat(rover: Rover) -> Terrain:
    return _step(rover, 0.0)


def _step(rover: Rover, height: float) -> Terrain:
    """Return level ground that rises by a step across x = 0."""
    cell = 0.1 * rover.wheel.radius
    half = 2.0 * _length(rover)
    axis = cell * np.arange(-int(half / cell), int(half / cell) + 1)
    wide = cell * np.arange(-int(0.6 * half / cell), int(0.6 * half / cell) + 1)
    profile = np.where(axis > 0.0, height, 0.0)
    return Terrain(np.tile(profile, (len(wide), 1)), cell, (axis[0], wide[0]))


def tallest_step(rover: Rover, policy: str = "equal", friction: float | None = None) -> float:
    """Return the height [m] of the tallest step that the rover climbs straight on.

    Only what the wheels can do counts: friction, torque, contact and suspension; not the safety
    limits of tilt, margin, clearance and drop. Heights are tried from low to high, for a step may
    be climbed that is taller than one that is not.
    """
    limits = replace(
        rover.limits, tilt=1.5, tip_over_ratio=0.0, belly_clearance=0.0, wheel_drop=100.0
    )
    able = replace(rover, limits=limits)
    climbed, height = 0.0, SEARCH_STEP
    while height < 4.0 * rover.wheel.radius and climbs(able, height, policy, friction):
        climbed, height = height, height + SEARCH_STEP
    low, high = climbed, height
    while high - low > STEP_TOLERANCE:
        middle = 0.5 * (low + high)
        if climbs(able, middle, policy, friction):
            low = middle
        else:
            high = middle
    return low


def climbs(rover: Rover, height: float, policy: str, friction: float | None) -> bool:
    """Tell whether a rover gets up a step of a height [m], belly included."""
    reach = 0.75 * _length(rover)
    x = np.linspace(-reach, reach, round(2.0 * reach / SPACING) + 1)
    poses = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    prediction = sweep_path(rover, _step(rover, height), poses, policy=policy, friction=friction)
    return judge(rover, prediction).traversable
