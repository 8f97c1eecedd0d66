"""Checks of the cheap test of nodes against the model."""

import numpy as np

from benchmarks.way_trials.grounds import Case
from rover_physics.rover.turning import wheelbase
from rover_planner.planning.lattice.ground_estimate import estimate_ground
from rover_planner.planning.lattice.headings import HEADINGS
from rover_planner.planning.lattice.nodes import Nodes, nodes_within

SHARES = (0.25, 0.1, 0.05)
"""Distances of neighbouring nodes [wheelbases], one lattice after the other."""
_BATCH = 20_000


def check_estimate(case: Case, count: int) -> dict[str, float]:
    """Return how many nodes the cheap test refuses, and how many of these the model passes.

    Lattices get finer until `count` nodes are refused; at most so many are asked about.
    """
    checked, wrong, share = 0, 0, np.nan
    for cell in SHARES:
        nodes = _nodes(case, cell * wheelbase(case.rover))
        groundless = estimate_ground(case.rover, case.terrain, nodes)[0]
        if np.isnan(share):
            share = float(groundless.mean())
        refused = np.flatnonzero(groundless)
        if cell != SHARES[0]:
            refused = np.random.default_rng(0).permutation(refused)
        refused = refused[: count - checked]
        for first in range(0, len(refused), _BATCH):
            codes = case.judge.stand(nodes.poses(refused[first : first + _BATCH]))
            wrong += sum(code == "" for code in codes)
        checked += len(refused)
        if checked >= count:
            break
    return {"checked": checked, "wrong": wrong, "share": share}


def _nodes(case: Case, cell: float) -> Nodes:
    """Return the nodes of a whole map."""
    xmin, xmax, ymin, ymax = case.terrain.bounds
    nodes = nodes_within(cell, (xmin, ymin), (xmax, ymax))
    assert nodes.count % HEADINGS == 0
    return nodes
