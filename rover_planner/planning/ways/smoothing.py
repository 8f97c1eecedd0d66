# SPDX-License-Identifier: Apache-2.0
"""Smooths a way: stretches of it are replaced by single curves that cost less."""

import numpy as np

from rover_physics.numerics.interruption import check_interruption
from rover_planner.planning.dubins import dubins_paths
from rover_planner.planning.lattice.judge import Judge
from rover_planner.planning.lattice.primitives import Gear
from rover_planner.planning.lattice.search import Stretch

SPANS = (4, 8, 16, 8, 4, 3, 2)
"""Numbers of pieces that one curve replaces, one pass over the way after the other."""
RADII = (2.0, 1.0)
"""Radii of the curves that are tried [tightest radii of the rover]."""
GAIN = 1e-3
"""Share of its cost that a curve must save."""


def smooth(
    judge: Judge, stretches: list[Stretch], radius: float, most_poses: int
) -> list[Stretch]:
    """Return stretches of a path that leads along fewer, wider curves and costs less.

    Args:
        judge: The model, which judges each new curve.
        stretches: The path.
        radius: Tightest radius of the rover [m].
        most_poses: Number of poses that the model may be asked about.
    """
    allowed = judge.poses + most_poses
    for span in SPANS:
        first = 0
        while first + span <= len(stretches) and judge.poses < allowed:
            check_interruption()
            found = _replace(judge, stretches[first : first + span], radius)
            if found is not None:
                stretches = [*stretches[:first], found, *stretches[first + span :]]
                first += 1
            else:
                first += max(1, span // 2)
    return stretches


def _replace(judge: Judge, old: list[Stretch], radius: float) -> Stretch | None:
    """Return one curve driven forwards that costs less than some stretches; None if none does."""
    start, end = old[0].poses[0], old[-1].poses[-1]
    spacing = judge.options.waypoint_spacing
    cost = sum(one.cost for one in old) * (1.0 - GAIN)
    for scale in RADII:
        poses = np.column_stack(dubins_paths(start, end, scale * radius, spacing, 1)[0])
        poses[0], poses[-1, :2] = start, end[:2]
        if np.hypot(*np.diff(poses[:, :2], axis=0).T).sum() >= cost:
            continue
        judged = judge.judge([poses], [Gear.FORWARD])[0]
        if judged.cost < cost:
            return Stretch(poses, Gear.FORWARD, judged.cost)
    return None
