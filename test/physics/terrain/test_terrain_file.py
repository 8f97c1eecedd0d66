# SPDX-License-Identifier: Apache-2.0
"""Terrain files: their size is known before they are unpacked, and memory stays below it."""

import time
import tracemalloc

import numpy as np
import pytest

from rover_physics.errors import TerrainError
from rover_physics.terrain.grid import load_terrain
from rover_physics.terrain.terrain_file import MAX_CELL_BYTES, MAX_CELLS

SIDE = 12_000


def peak_of(run) -> float:
    """Return the largest memory [bytes] that a function takes."""
    tracemalloc.start()
    try:
        run()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_small_file_of_12000_by_12000_cells_is_refused_before_it_is_unpacked(tmp_path):
    path, cells = tmp_path / "map.npz", np.zeros((SIDE, SIDE), np.uint8)
    np.savez_compressed(path, elevation=cells, resolution=0.05, origin=np.zeros(2))
    assert path.stat().st_size < 1_000_000

    def load():
        said = f"elevation has 12000 x 12000 cells; the limit is {MAX_CELLS}"
        with pytest.raises(TerrainError, match=said):
            load_terrain(path)

    began = time.perf_counter()
    assert peak_of(load) < 5_000_000
    assert time.perf_counter() - began < 20.0


@pytest.mark.parametrize("layer", ["elevation", "soil"])
def test_the_limit_of_cells_is_a_parameter_and_holds_for_each_layer(tmp_path, layer):
    entries = {"elevation": np.zeros((10, 12)), "resolution": 0.1, "origin": [0, 0]}
    np.savez(tmp_path / "a.npz", **entries)
    assert load_terrain(tmp_path / "a.npz", max_cells=120).elevation.shape == (10, 12)
    np.savez(tmp_path / "a.npz", **entries | {layer: np.zeros((100, 100), np.int64)})
    with pytest.raises(
        TerrainError, match=rf"a\.npz: {layer} has 100 x 100 cells; the limit is 120"
    ):
        load_terrain(tmp_path / "a.npz", max_cells=120)


@pytest.mark.parametrize(
    ("dtype", "order", "heights_alone"),
    [
        ("<f4", "C", True), (">f8", "C", False), ("<f4", "F", False), ("|u1", "C", False),
    ],
)  # fmt: skip
def test_loading_takes_at_most_twice_the_memory_of_the_largest_map(
    tmp_path, dtype, order, heights_alone
):
    shape = (600, 700)
    grid = np.asarray(np.random.default_rng(1).integers(1, 99, shape), dtype, order=order)
    layers = {
        "friction": grid, "soil": np.zeros(shape, np.int64), "soil_names": ["dry_sand"],
        "elevation_std": grid,
    }  # fmt: skip
    (np.savez_compressed if heights_alone else np.savez)(
        tmp_path / "a.npz", elevation=grid, resolution=0.1, origin=[0, 0],
        **({} if heights_alone else layers),
    )  # fmt: skip
    terrain = load_terrain(tmp_path / "a.npz", max_cells=grid.size)
    np.testing.assert_array_equal(terrain.elevation, grid.astype(np.float64))
    peak = peak_of(lambda: load_terrain(tmp_path / "a.npz", max_cells=grid.size))
    assert peak < 2 * (8 if heights_alone else MAX_CELL_BYTES) * grid.size
