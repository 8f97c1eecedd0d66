# SPDX-License-Identifier: Apache-2.0
"""Where on this map can the rover go at all? Every cell, many headings, and what is reachable.

`rover_planner survey` judges the rover all over a map, on the cores of this machine or a cluster,
and goes on where it was interrupted. `rover_planner reachable` then finds what can be reached from
a place and returned from. The store that both fill is read with any Zarr library.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import zarr
from matplotlib import pyplot

from rover_physics import load_terrain

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
store = folder / "07_spirit.zarr"


def run(*words: object) -> dict:
    """Run a command of rover_planner and return the JSON that it prints."""
    command = [sys.executable, "-m", "rover_planner", *map(str, words)]
    return json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)


survey = run("survey", "lsr1", "spirit", store, "--headings", 8, "--step", 4, "--max-gap", 0.2)
area = run("reachable", store, "--from=-44.4,-19.4")
print(f"{survey['surveyed']} cells at 8 headings, on {survey['chunks']} chunk(s)")
for name, share in survey["best_class"].items():
    print(f"  {share:6.1%} {name} at the best heading")
print(f"reachable with return: {area['area']:.1f} m2, at most {area['longest']:.1f} m away")

group = zarr.open_group(store, mode="r")
passes = group["passable_headings"][:].astype(np.uint8)  # a bit for each of the 8 headings
counts = np.unpackbits(passes[..., None], axis=-1).sum(axis=-1)
distance = group["reachable/distance"][:]
figure, axes = pyplot.subplots(1, 2, figsize=(11, 5), layout="constrained")
x0, x1, y0, y1 = load_terrain("spirit").bounds
for axis, layer, title in (
    (axes[0], counts, "number of headings, of 8, at which the rover passes"),
    (axes[1], distance, "length of the path there [m]"),
):
    drawn = axis.imshow(layer, origin="lower", extent=(x0, x1, y0, y1))
    axis.set(title=title)
    axis.plot(-44.4, -19.4, "r*", markersize=12)
    figure.colorbar(drawn, ax=axis, shrink=0.8)
figure.savefig(folder / "07_survey.png")
