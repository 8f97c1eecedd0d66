# SPDX-License-Identifier: Apache-2.0
"""The ground around a path with the heights of a sample, where heights are uncertain."""

from dataclasses import replace
from typing import Any

import numpy as np

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.packed_model import PackedModel
from rover_physics.terrain.grid import Terrain
from rover_physics.terrain.ground import new_ground, with_soils

SEED = 6
"""Seed of the heights."""


def cut_around(terrain: Terrain, places: Floats, margin: float) -> Terrain:
    """Return the part of a terrain within `margin` [m] of a box around places (n, 2) [m]."""
    shape = np.array(terrain.elevation.shape[::-1])
    low, high = places.min(axis=0) - margin, places.max(axis=0) + margin
    first, last = (
        np.clip(np.round((end - terrain.origin) / terrain.resolution), 0, shape - 1).astype(int)
        for end in (low, high)
    )
    first = np.minimum(first, np.maximum(last - 1, 0))
    columns, rows = (slice(a, b + 2) for a, b in zip(first, last, strict=True))
    layers: dict[str, Any] = {
        name: None if layer is None else np.ascontiguousarray(layer[rows, columns])
        for name in ("elevation", "friction", "soil", "elevation_std", "ground_class")
        for layer in (getattr(terrain, name),)
    }
    x, y = np.asarray(terrain.origin) + terrain.resolution * first
    return replace(terrain, origin=(float(x), float(y)), **layers)


def change_heights(model: PackedModel, part: Terrain, number: int) -> PackedModel:
    """Return the model on a part of its terrain, with the heights of a sample.

    The heights of cells err independently, by their `elevation_std`.
    """
    assert part.elevation_std is not None
    noise = np.random.default_rng([SEED, number]).standard_normal(part.elevation.shape)
    changed = replace(part, elevation=part.elevation + noise * part.elevation_std)
    soils = model.ground.arrays["soils"]
    assert soils is not None
    ground = with_soils(new_ground(changed), soils)
    records = model.records.copy()
    records["ground"] = ground.records[0]
    return replace(model, records=records, ground=ground)
