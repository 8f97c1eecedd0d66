# SPDX-License-Identifier: Apache-2.0
"""Places near a goal on unknown ground where the rover can stand: the frontier of the map."""

import numpy as np

from rover_planner.planning.lattice.connections import Connection
from rover_planner.planning.lattice.headings import HEADINGS
from rover_planner.planning.lattice.judge import Judge
from rover_planner.planning.lattice.nodes import Nodes
from rover_planner.planning.lattice.primitives import Gear

PLACES = 48
"""Number of places that are offered to the search."""
PRICE = 10.0
"""Cost of each metre that is left to the goal [m of level ground]."""
_BATCH = 1000


def connect_frontier(judge: Judge, nodes: Nodes, goal: np.ndarray) -> list[Connection]:
    """Return the nodes nearest to a goal (3,) on which the rover can stand, as ends of a way.

    They lie at least a quarter of the wheelbase apart. What is left to the goal has a price.
    """
    everywhere = np.arange(0, nodes.count, HEADINGS)
    away = np.hypot(*(nodes.poses(everywhere)[:, :2] - goal[:2]).T)
    by_distance = everywhere[np.argsort(away, kind="stable")]
    found: list[Connection] = []
    chosen: list[np.ndarray] = []
    apart, places = 0.25 * judge.rover.wheelbase, max(1, _BATCH // HEADINGS)
    for first in range(0, len(by_distance), places):
        some = by_distance[first : first + places]
        asked = (some[:, None] + np.arange(HEADINGS)).ravel()
        poses = nodes.poses(asked)
        stands = np.array([code == "" for code in judge.stand(poses)])
        for node, pose in zip(asked[stands], poses[stands], strict=True):
            near = [np.hypot(*(pose - other)[:2]) for other in chosen]
            if near and 1e-9 < min(near) < apart:
                continue
            if not near or min(near) > 1e-9:
                if len(chosen) == PLACES:
                    return found
                chosen.append(pose)
            left = float(np.hypot(*(pose - goal)[:2]))
            found.append(Connection(int(node), Gear.FORWARD, pose[None, :], 0.0, PRICE * left))
    return found
