"""Finds paths that fail at a waypoint in any case, without looking at what lies between waypoints.

It takes a fraction of the time of a judgement: the places between waypoints where contacts jump
cost most of it on rough ground.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from rover_physics.names import OPTIMAL
from rover_physics.numerics.quiet import quiet
from rover_physics.numerics.read_only import view_read_only
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import path_motions
from rover_physics.prediction.sweep import check_poses, evaluator
from rover_physics.prediction.sweep_options import DEFAULT_OPTIONS, SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.first_failure import find_suspects, limits_of
from rover_physics.traversability.judge_poses import judge_results

STRIDES = (8, 1)
"""Every so many waypoints are evaluated first, then all."""


@quiet
def find_sure_failures(
    rover: Rover,
    terrain: Terrain,
    paths: Sequence[ArrayLike],
    options: SweepOptions = DEFAULT_OPTIONS,
) -> list[str]:
    """Return for each path the code of a waypoint that fails, "" if none fails in any case.

    A path with a code is refused by `judge_paths` too, perhaps for another reason that comes
    first. One without may still be refused: for what lies between its waypoints, for a fall, for
    an uncertain map or for the control margin.

    Args:
        rover: The rover.
        terrain: The ground.
        paths: Poses of each path, (n, 3) x, y [m] and yaw [rad], map frame.
        options: As for `sweep_path`.

    Raises:
        PoseError, ModelError, SoilError: As `sweep_path`.
    """
    if options.policy == OPTIMAL:
        options = replace(options, control_margin=0.0)  # equal torques may pass without a margin
    model = pack_model(rover, terrain, options)
    limits, evaluate_at = limits_of(rover, model), evaluator(model)
    poses = [check_poses(path) for path in paths]
    motions = [path_motions(model, path) for path in poses]
    codes, open_paths = [""] * len(paths), np.arange(len(paths))
    for stride in STRIDES:
        rows = [_rows(len(poses[k]), stride, STRIDES[0]) for k in open_paths]
        if not sum(map(len, rows)):
            continue
        at = np.concatenate([poses[k][row] for k, row in zip(open_paths, rows, strict=True)])
        by = np.concatenate([motions[k][row] for k, row in zip(open_paths, rows, strict=True)])
        results = evaluate_at(at, motions=by)
        ends = np.cumsum([len(row) for row in rows])
        failed = []
        for end, row in zip(ends, rows, strict=True):
            part = view_read_only(results[end - len(row) : end])
            failed.append(find_suspects(part, limits)[1])
        sure = np.array(failed) >= 0
        places = ends - [len(row) for row in rows] + failed
        found = judge_results(rover, model, at[places[sure]], results[places[sure]])
        for k, code in zip(open_paths[sure], found, strict=True):
            codes[k] = code
        open_paths = open_paths[~sure]
    return codes


def _rows(count: int, stride: int, first: int) -> np.ndarray:
    """Return every `stride`-th of `count` rows and the last one, without those at `first`."""
    rows = np.arange(count)
    coarse = (rows % first == 0) | (rows == count - 1)
    return np.flatnonzero(coarse if stride == first else ~coarse)
