# SPDX-License-Identifier: Apache-2.0
"""What would make it passable: three refused paths, and the smallest changes that make them pass.

Each remedy is judged by the same model, and fails with a chance of at most 0.05. The same is
`rover_planner advise`, and the service ~/advise of traverse_server.
"""

import sys
from pathlib import Path

import numpy as np

from rover_physics import Terrain, load_rover, load_terrain
from rover_planner.advice.advise import grow_advice
from rover_planner.advice.case import Case
from rover_planner.figures.path_pictures import draw_advice
from rover_planner.planning.search.query import Site

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
rover = load_rover("lsr1")


def line(x: float, y: float, yaw: float, length: float) -> np.ndarray:
    """Return poses (n, 3) straight ahead, a waypoint every 5 cm."""
    s = np.arange(0.0, length, 0.05)
    return np.column_stack([x + s * np.cos(yaw), y + s * np.sin(yaw), np.full_like(s, yaw)])


axis = np.arange(-3.0, 3.01, 0.05)
x, y = np.meshgrid(axis, axis)
rock = Terrain(0.3 * np.exp(-((x - 0.2) ** 2 + (y - 0.2) ** 2) / 0.02), 0.05, (-3.0, -3.0))
slope = Terrain(0.3 * x, 0.05, (-3.0, -3.0))
ahead = line(-1.5, 0.0, 0.0, 3.0)
cases = {
    "spirit": Case(Site(rover, load_terrain("spirit")), line(-44.4, -19.4, -2.5, 2.0)),
    "rock": Case(Site(rover, rock), ahead),
    "payload": Case(Site(rover, slope), ahead).change(payload=4.0),
}
for name, case in cases.items():
    *_, advice = grow_advice(case)
    print(f"{name}: refused: {advice.judged.verdict.reason}")
    for remedy in (*advice.remedies, *advice.others):
        print(f"  {remedy.describe()}")
    draw_advice(folder / f"advice_{name}.png", advice, name)
