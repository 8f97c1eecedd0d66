# SPDX-License-Identifier: Apache-2.0
"""Compares three torque policies by the tallest step that the rover climbs.

`equal`: all wheels pull alike. `servo`: each wheel has a speed servo, so torque goes where there
is grip. `optimal`: a traction controller shares the torques so that the least friction is needed.
On ground with enough grip the last two climb steps that are taller than a wheel's radius; equal
torques never do. docs/studies.md says how far to trust the model on tall steps.
"""

import bisect
import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot

from rover_physics import SweepOptions, Terrain, judge_path, load_rover

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
rover = load_rover("lsr1")
x = np.arange(-1.2, 1.2, 0.02)
poses = np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])
heights = np.arange(1, 41) / 100.0


def step(height: float) -> Terrain:
    """Return ground that rises by a height [m] at x = 0, in cells of 2 cm."""
    across = np.arange(-2.5, 2.5, 0.02)
    return Terrain(np.tile(np.where(across > 0.0, height, 0.0), (101, 1)), 0.02, (-2.5, -1.0))


def tallest_step(policy: str, friction: float) -> float:
    """Return the height [m] of the tallest step on which the rover is not refused."""
    options = SweepOptions(policy=policy, friction=friction)

    def is_refused(height: float) -> bool:
        _, verdict = judge_path(rover, step(height), poses, options, stop_at_failure=True)
        return not verdict.traversable

    return 0.01 * bisect.bisect_left(heights, True, key=is_refused)


policies, frictions = ("equal", "servo", "optimal"), np.arange(3, 11) / 10.0
tallest = {policy: [tallest_step(policy, mu) for mu in frictions] for policy in policies}
print("tallest step [cm] on ground of friction")
print(" " * 8 + "".join(f"{mu:6.1f}" for mu in frictions))
for policy in policies:
    print(f"{policy:8}" + "".join(f"{100 * height:6.0f}" for height in tallest[policy]))

figure, axes = pyplot.subplots(figsize=(6, 4), layout="constrained")
for policy, marker in zip(policies, "os^", strict=True):
    axes.plot(frictions, 100 * np.array(tallest[policy]), marker + "-", label=policy)
axes.axhline(100 * rover.wheel.radius, color="gray", linestyle=":", label="wheel radius")
axes.set(xlabel="friction coefficient", ylabel="tallest step [cm]", ylim=(0, None))
axes.legend()
figure.savefig(folder / "02_policies.png")
