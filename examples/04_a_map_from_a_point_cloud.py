# SPDX-License-Identifier: Apache-2.0
"""A map from a sensor's points: cells, gaps, noise, and what is not known.

A sensor gives scattered points, dense nearby and thin far away, with noise, and nothing from
behind rocks. `terrain_from_point_cloud` puts them into cells as the node traverse_server does.
Cells without a point are unknown, and no path leads over them unless small gaps are filled.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot
from sensor_msgs.msg import PointCloud2, PointField

from msg_adapters.elevation import terrain_from_point_cloud
from rover_physics import judge_path, load_rover, save_terrain

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
random = np.random.default_rng(4)

# What a sensor at x = y = 0 may see: waves of 4 cm, a rock, its shadow, noise of 3 mm.
distance, bearing = 6.0 * random.random(60_000) ** 0.7, random.uniform(-1.2, 1.2, 60_000)
x, y = distance * np.cos(bearing), distance * np.sin(bearing)
rock = 0.35 * np.exp(-(((x - 3.0) ** 2 + (y + 0.7) ** 2) / 0.06))
z = 0.04 * np.sin(2.0 * x) * np.cos(1.5 * y) + rock + random.normal(0.0, 0.003, len(x))
in_shadow = (distance > 3.2) & (np.abs(bearing - np.arctan2(-0.7, 3.0)) < 0.08)
points = np.column_stack([x, y, z])[~in_shadow].astype("<f4")

cloud = PointCloud2(height=1, width=len(points), point_step=12, row_step=12 * len(points))
cloud.header.frame_id = "map"
cloud.fields = [
    PointField(name=name, offset=4 * k, datatype=PointField.FLOAT32, count=1)
    for k, name in enumerate("xyz")
]
cloud.data.frombytes(points.tobytes())

seen = terrain_from_point_cloud(cloud, resolution=0.05)
filled = seen.fill_gaps(max_gap=0.2)
save_terrain(folder / "04_map.npz", filled)
for name, terrain in (("seen", seen), ("filled", filled)):
    print(f"{name}: {np.isfinite(terrain.elevation).mean():.0%} of the cells are known")

rover, s = load_rover("lsr1"), np.arange(1.2, 4.6, 0.02)
figure, axes = pyplot.subplots(1, 2, figsize=(8, 6), layout="constrained", sharey=True)
for axis, terrain, title in zip(axes, (seen, filled), ("seen", "gaps filled"), strict=True):
    xmin, xmax, ymin, ymax = terrain.bounds
    axis.set(title=title, xlabel="x [m]")
    axis.imshow(terrain.elevation, origin="lower", extent=(xmin, xmax, ymin, ymax))
    for turn in (0.35, 0.0, -0.22):  # straight ahead in three directions
        poses = np.column_stack([s * np.cos(turn), s * np.sin(turn), np.full_like(s, turn)])
        _, verdict = judge_path(rover, terrain, poses)
        axis.plot(*poses[:, :2].T, color="white" if verdict.traversable else "red")
        print(f"{title}, {turn:+.2f} rad: {verdict.reason or 'traversable'}")
figure.savefig(folder / "04_map.png")
