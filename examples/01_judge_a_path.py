# SPDX-License-Identifier: Apache-2.0
"""Can the rover drive this path, and if not, why and where?

One call judges a path of poses x, y, yaw on an elevation map: here two metres on Mars, as Spirit's
cameras saw it. The verdict names the first waypoint that fails, the wheel and the limit; the
prediction has every number of every waypoint. The picture shows both.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot
from matplotlib.colors import LightSource

from rover_physics import judge_path, load_rover, load_terrain
from rover_physics.names import WHEELS

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
rover, mars = load_rover("lsr1"), load_terrain("spirit")

s, yaw = np.arange(0.0, 2.0, 0.02), -2.5  # straight ahead, a waypoint every 2 cm
poses = np.column_stack([-44.4 + s * np.cos(yaw), -19.4 + s * np.sin(yaw), np.full_like(s, yaw)])
prediction, verdict = judge_path(rover, mars, poses)

print("traversable" if verdict.traversable else f"refused at waypoint {verdict.first_failure}")
print(verdict.reason)
print(f"largest friction utilisation {verdict.max_friction_utilisation:.2f}")
print(f"smallest tip-over ratio {verdict.min_tip_over_ratio:.2f}")
print(f"energy {prediction.energy[-1]:.1f} J in {prediction.time[-1]:.0f} s")

figure, (ground, loads, used) = pyplot.subplots(1, 3, figsize=(13, 4), layout="constrained")
x0, x1, y0, y1 = mars.bounds
shade = LightSource().hillshade(mars.elevation, dx=mars.resolution, dy=mars.resolution)
ground.imshow(shade, cmap="gray", origin="lower", extent=(x0, x1, y0, y1))
ground.set(xlim=(-48, -43), ylim=(-22, -18), title="path on the map [m], to the lower left")
ground.plot(*poses[:, :2].T)
ground.plot(*poses[verdict.first_failure, :2], "rx", markersize=10)
for k, wheel in enumerate(WHEELS):
    loads.plot(prediction.distance, prediction.wheel_loads[:, k], label=wheel)
    used.plot(prediction.distance, prediction.friction_utilisation[:, k])
loads.set(title="wheel loads [N]", xlabel="distance [m]")
used.set(title="friction utilisation, limit 1", xlabel="distance [m]", ylim=(0, 1.4))
used.axhline(1.0, color="red", linestyle="--")
between = prediction.between  # poses on faces that a wheel climbs from one waypoint to the next
largest = between.friction_utilisation.max(axis=1)
used.plot(prediction.distance[between.waypoint], largest, "kx", label="on faces in between")
used.legend()
figure.legend(*loads.get_legend_handles_labels(), loc="outside lower center", ncols=6)
figure.savefig(folder / "01_path.png")
