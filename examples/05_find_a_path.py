# SPDX-License-Identifier: Apache-2.0
"""A path around obstacles: where the straight line is refused, `rover_planner plan` searches.

The search judges each edge by the same physics as every path, so what it finds is traversable, and
what it does not find it explains. It reads and writes files, prints one line of JSON, and needs no
ROS; traverse_server does the same for each question whose direct paths are refused.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot
from matplotlib.colors import LightSource

from rover_physics import judge_path, load_rover, load_terrain

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
command = [sys.executable, "-m", "rover_planner"]
map_file, path_file = folder / "05_mars.npz", folder / "05_path.npz"
start, goal = (-8.0, -8.0, 0.0), (6.0, 7.0, 1.57)

subprocess.run([*command, "terrain", map_file, "--seed", "7"], check=True)
mars = load_terrain(map_file)

dx, dy = goal[0] - start[0], goal[1] - start[1]
s, yaw = np.arange(0.0, np.hypot(dx, dy), 0.02), np.arctan2(dy, dx)
line = np.column_stack([start[0] + s * np.cos(yaw), start[1] + s * np.sin(yaw), s * 0.0 + yaw])
_, verdict = judge_path(load_rover("lsr1"), mars, line)
print(f"straight ahead: {verdict.reason or 'traversable'}")

command += ["plan", "lsr1", map_file, path_file, "--budget", "3"]
command += [f"--start={','.join(map(str, start))}", f"--goal={','.join(map(str, goal))}"]
answer = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
print(f"search: {answer['outcome']}, {answer['length']:.1f} m, {answer['energy']:.1f} J, "
      f"{answer['edges_judged']} of {answer['edges']} edges judged")  # fmt: skip
path = np.load(path_file)
print(f"largest friction utilisation on it: {path['friction_utilisation'].max():.2f}")

figure, axis = pyplot.subplots(figsize=(7, 7), layout="constrained")
x0, x1, y0, y1 = mars.bounds
shade = LightSource().hillshade(mars.elevation, dx=mars.resolution, dy=mars.resolution)
axis.imshow(shade, cmap="gray", origin="lower", extent=(x0, x1, y0, y1))
axis.plot(*line[:, :2].T, "r--", label="straight ahead")
axis.plot(*line[verdict.first_failure, :2], "rx", markersize=12, label="refused here")
axis.plot(*path["poses"][:, :2].T, "C0", linewidth=2, label="found")
axis.legend(loc="lower right")
figure.savefig(folder / "05_path.png")
