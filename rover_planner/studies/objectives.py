# SPDX-License-Identifier: Apache-2.0
"""Objectives of studies: utilisation, tip-over margin, energy, tallest step, load imbalance."""

import operator
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from rover_physics.errors import ModelError
from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_physics.terrain.terrain_file import MAX_CELLS
from rover_physics.traversability.judge import judge_path, judge_paths, judge_poses
from rover_planner.planning.path_query import waypoint_spacing_for
from rover_planner.studies.study_file import STEP_TOLERANCE, Study, StudyDrive

NO_LIMIT = 1e9
"""Value that disables a limit."""
SEARCH_STEPS = 5.0
"""Number of step heights in a wheel radius that are tried, before bisection."""
MAX_STEP = 10.0
"""Tallest step that is tried [m]."""
MAX_WAYPOINTS = 200_000
"""Largest number of waypoints of a drive."""


def evaluate(study: Study, rover: Rover) -> tuple[float, str]:
    """Return the objective of a study for a rover, and a note.

    The note says what limits the value or, where that is NaN, why it is impossible.

    Raises:
        RoverError: A terrain cannot be loaded, or the model refuses an argument.
    """
    if study.objective == "tallest_step":
        height = tallest_step(rover, study.policy, study.friction)
        taller = height + STEP_TOLERANCE
        reason = why_not_climbed(rover, taller, study.policy, study.friction)
        return height, f"{taller:.3f} m: {reason}"
    if study.objective == "load_imbalance":
        loads = level_loads(rover)
        return float(loads.max() / loads.mean()), ""
    scores = [_score_drive(study, rover, k) for k in range(len(study.drives))]
    failed = [score for score in scores if not np.isfinite(score[0])]
    if failed:
        return failed[0]
    choose = min if study.wants_largest else max
    return choose(scores, key=operator.itemgetter(0))


def level_loads(rover: Rover) -> Floats:
    """Return the loads (6,) of the wheels at rest on level ground [N]."""
    return judge_poses(rover, step_ground(rover, 0.0), np.zeros((1, 3)))[0].wheel_loads[0]


def _score_drive(study: Study, rover: Rover, k: int) -> tuple[float, str]:
    """Return objective and note of drive k; all limits must hold except that of the objective."""
    drive, where = study.drives[k], f"drive {k + 1}"
    path = drive.length * np.linspace(0.0, 1.0, _count_steps(rover, drive.length) + 1)
    x, y, yaw = drive.start
    poses = np.column_stack(
        [x + path * np.cos(yaw), y + path * np.sin(yaw), np.full_like(path, yaw)]
    )
    ground = _ground(rover, drive)
    prediction, verdict = judge_path(
        _lift_limit(study, rover),
        ground,
        poses,
        SweepOptions(friction=study.friction, policy=study.policy, soil=study.soil),
    )
    if not verdict.traversable:
        return float("nan"), f"{where}: {verdict.reason}"
    if study.objective == "worst_utilisation":
        return verdict.max_friction_utilisation, where
    if study.objective == "drive_energy":
        return float(prediction.energy[-1] / prediction.distance[-1]), where
    # The verdict's ratio is relative to the same rover on flat ground; it cannot compare rovers.
    flat_angle = float(pack_model(rover, ground).settings.flat_angle)
    return verdict.min_tip_over_ratio * flat_angle, where


def _count_steps(rover: Rover, length: float) -> int:
    """Return the number of steps from waypoint to waypoint along a length [m], at least 1.

    Raises:
        ModelError: There are more than MAX_WAYPOINTS.
    """
    spacing = waypoint_spacing_for(rover)
    if not length / spacing <= MAX_WAYPOINTS:
        raise ModelError(
            f"a drive is {length:g} m long; it must be at most {MAX_WAYPOINTS * spacing:g} m"
        )
    return max(round(length / spacing), 1)


def _make_axis(half: float, cell: float, aspect: float = 1.0) -> Floats:
    """Return the coordinates [m] of cells from -half to half; aspect is width over length.

    Raises:
        ModelError: The ground would have more than MAX_CELLS.
    """
    count = 2.0 * half / cell + 1.0
    if not aspect * count * count <= MAX_CELLS:
        raise ModelError(
            f"a ground of {2.0 * half:.3g} m in cells of {cell:.3g} m has more than {MAX_CELLS} "
            "cells; drives, starts and wheels must be smaller"
        )
    return np.asarray(cell * np.arange(-int(half / cell), int(half / cell) + 1))


def _lift_limit(study: Study, rover: Rover) -> Rover:
    """Return the rover without the limit that the objective measures."""
    lifted: dict[str, Any] = {
        "worst_utilisation": {"friction_utilisation": NO_LIMIT},
        "tip_over_margin": {"tip_over_ratio": -NO_LIMIT},
    }.get(study.objective, {})
    return replace(rover, limits=replace(rover.limits, **lifted))


def _ground(rover: Rover, drive: StudyDrive) -> Terrain:
    if drive.file is not None:
        return _load_once(drive.file)
    room = drive.length + abs(drive.start[0]) + abs(drive.start[1])
    if drive.slope is None:
        return step_ground(rover, drive.step or 0.0, room)
    cell = 0.2 * rover.wheel.radius
    axis = _make_axis(room + 2.0 * _length(rover), cell)
    x = np.broadcast_to(axis, (len(axis), len(axis)))
    return Terrain(np.tan(drive.slope) * x, cell, (axis[0], axis[0]))


@lru_cache(maxsize=16)
def _load_once(file: str) -> Terrain:
    return load_terrain(file)


def _length(rover: Rover) -> float:
    return rover.wheelbase + 2.0 * rover.wheel.radius


def step_ground(rover: Rover, height: float, room: float = 0.0) -> Terrain:
    """Return level ground that rises by a step across x = 0, with room [m] to all sides."""
    cell = 0.1 * rover.wheel.radius
    half, half_width = room + 2.0 * _length(rover), room + 1.2 * _length(rover)
    axis = _make_axis(half, cell, half_width / half)
    wide = _make_axis(half_width, cell)
    profile = np.where(axis > 0.0, height, 0.0)
    return Terrain(np.tile(profile, (len(wide), 1)), cell, (axis[0], wide[0]))


def tallest_step(rover: Rover, policy: str = "equal", friction: float | None = None) -> float:
    """Return the height [m] of the tallest step that the rover climbs straight on.

    Only friction, torque, contact and suspension count, not the safety limits of tilt, tip-over
    margin, clearance and drop. Heights are tried from low to high, because a rover may climb a
    step that is higher than one that it cannot climb.
    """
    step = rover.wheel.radius / SEARCH_STEPS
    climbed, height = 0.0, step
    highest = min(4.0 * rover.wheel.radius, MAX_STEP)
    while height < highest and not why_not_climbed(rover, height, policy, friction):
        climbed, height = height, height + step
    low, high = climbed, height
    while high - low > STEP_TOLERANCE:
        middle = 0.5 * (low + high)
        if why_not_climbed(rover, middle, policy, friction):
            high = middle
        else:
            low = middle
    return low


def why_not_climbed(rover: Rover, height: float, policy: str, friction: float | None) -> str:
    """Return the reason why a rover does not climb a step of a height [m]; empty if it does."""
    limits = replace(
        rover.limits, tilt=1.5, tip_over_ratio=0.0, belly_clearance=0.0, wheel_drop=100.0
    )
    able = replace(rover, limits=limits)
    half = 0.75 * _length(rover)
    x = np.linspace(-half, half, _count_steps(rover, 2.0 * half) + 1)
    poses = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
    judged = judge_paths(
        able,
        step_ground(rover, height),
        [poses],
        SweepOptions(policy=policy, friction=friction),
        check_entrapment=False,
    )
    return judged[0][1].reason
