# SPDX-License-Identifier: Apache-2.0
"""Your own rover: from the URDF that a robot already has to a rover file, and over a step.

A URDF has the joints, links and masses. A joint map names the joints and adds what a URDF does not
tell: friction, gravity, speed and safety limits. `rover_planner rover` makes a rover file of both;
from then on the rover works like a preset. The two files of this made-up rover are in rover/.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot

from rover_physics import SweepOptions, Terrain, judge_path, load_rover

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
files = Path(__file__).resolve().parent / "rover"
rover_file = folder / "kit_rover.yaml"
command = [sys.executable, "-m", "rover_planner", "rover", rover_file]
command += ["--from-urdf", files / "kit_rover.urdf", "--map", files / "kit_rover_joints.yaml"]
subprocess.run(command, check=True)

rover = load_rover(rover_file)
across = np.arange(-1.0, 1.0, 0.01)
profile = np.where(across > 0.0, 0.06, 0.0)  # a step of 6 cm at x = 0
ground = Terrain(np.tile(profile, (101, 1)), 0.01, (-1.0, -0.5))
x = np.arange(-0.6, 0.6, 0.01)
poses = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
for policy in ("equal", "servo"):
    prediction, verdict = judge_path(rover, ground, poses, SweepOptions(policy=policy))
    print(f"{policy}: {verdict.reason or 'climbs the step'}")
print(f"of {rover.weight:.1f} N, rear, middle and front wheel of a side carry on flat ground:")
print(prediction.wheel_loads[0, :3].round(1), "N")

figure, (side, loads) = pyplot.subplots(
    2, 1, figsize=(9, 5), layout="constrained", sharex=True, height_ratios=(1, 2)
)
side.plot(across, profile, color="black")
for waypoint, colour in zip((0, 40, 70, 119), ("C0", "C1", "C2", "C3"), strict=True):
    for wheel in prediction.wheel_centres[waypoint, :3]:  # those of the right side
        side.add_patch(pyplot.Circle(wheel[[0, 2]], rover.wheel.radius, fill=False, ec=colour))
    side.plot(*prediction.position[waypoint, [0, 2]], "o", color=colour)
side.plot(*prediction.position[:, [0, 2]].T, color="gray", linewidth=0.8, zorder=0)
side.set(aspect="equal", xlim=(-0.95, 0.95), title="wheels and body origin from the side [m]")
loads.plot(x, prediction.wheel_loads[:, :3], label=("rear", "middle", "front"))
loads.set(xlabel="x of the body origin [m]", ylabel="wheel load [N]")
loads.legend()
figure.savefig(folder / "03_own_rover.png")
