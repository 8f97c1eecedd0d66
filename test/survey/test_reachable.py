# SPDX-License-Identifier: Apache-2.0
"""What can be reached on a surveyed map, and returned from, agrees with scipy's graphs."""

import json
import tempfile
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")
import zarr
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from rover_physics import Terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.layers import pack_bits
from rover_planner.survey.reachable import (
    DISTANCE,
    GROUP,
    HeadingGrid,
    find_moves,
    find_reachable,
    search_area,
)
from rover_planner.survey.store import NOTES
from support.command_line import assert_refused
from support.survey_maps import make_request, survey_here

CELL = 0.25


def graph_of(may, turns):
    """Return the graph of nodes (row, column, heading) with all moves and turns, for scipy."""
    rows, columns, headings = may.shape
    moves = find_moves(headings, CELL)
    edges = {}
    for i, j, k in np.argwhere(may):
        ways = [(i + di, j + dj) for di, dj in moves.steps[k, : moves.counts[k]]]
        if all(0 <= a < rows and 0 <= b < columns and may[a, b, k] for a, b in ways):
            edges[(i, j, k), (*ways[-1], k)] = moves.lengths[k]
        for side in (-1, 1):
            other = (k + side) % headings
            if turns[i, j, k] and turns[i, j, other]:
                edges[(i, j, k), (i, j, other)] = 0.0
    size = rows * columns * headings
    at = [np.ravel_multi_index(np.array([edge[e] for edge in edges], int).reshape(-1, 3).T,
                               (rows, columns, headings)) for e in (0, 1)]  # fmt: skip
    # Explicit zeros are edges for scipy's sparse graphs.
    return csr_array((np.array(list(edges.values())), (at[0], at[1])), shape=(size, size))


@given(
    shape=st.tuples(st.integers(1, 10), st.integers(1, 10)),
    headings=st.sampled_from([1, 2, 3, 4, 8, 16, 24]),
    seed=st.integers(0, 10_000),
    share=st.floats(0.4, 1.0),
    chunk=st.integers(1, 10),
)
def test_areas_of_any_map_are_those_of_scipy(shape, headings, seed, share, chunk):
    rng, middle = np.random.default_rng(seed), (shape[0] // 2, shape[1] // 2)
    open_at = rng.random((*shape, headings)) < share
    open_at[middle] = True
    turns_at = open_at & (rng.random(open_at.shape) < 0.7)
    grid = HeadingGrid(pack_bits(open_at), pack_bits(turns_at), find_moves(headings, CELL), chunk)
    distance = np.full(shape, np.inf, np.float32)
    with tempfile.TemporaryDirectory() as folder:
        numbers = search_area(grid, middle, distance, Path(folder))
    # Dijkstra's algorithm and strong components on all nodes.
    size, first = open_at.size, np.ravel_multi_index(middle, shape) * headings
    graph = graph_of(open_at, turns_at)
    starts = [first + k for k in range(headings) if open_at.reshape(-1)[first + k]]
    out = dijkstra(graph, indices=starts, min_only=True).reshape(open_at.shape)
    at = graph.tocoo()
    tails, heads = (
        np.concatenate([ends, more])
        for ends, more in zip(at.coords, (starts, np.roll(starts, 1)), strict=True)
    )
    joined = csr_array((np.ones(len(tails)), (tails, heads)), shape=(size, size))
    _, labels = connected_components(joined, connection="strong")
    inside = (labels == labels[starts[0]]).reshape(open_at.shape)
    wanted = np.where(inside, out, np.inf).min(axis=2)
    np.testing.assert_allclose(distance, wanted, rtol=1e-5)
    assert numbers.cells == np.isfinite(wanted).sum()
    assert numbers.reached == np.isfinite(out).any(axis=2).sum()
    assert numbers.longest == distance[np.isfinite(distance)].max() == distance[numbers.farthest]


def test_the_area_is_kept_in_the_store_with_what_was_surveyed_then(tmp_path):
    request = make_request(headings=8)
    prepared = survey_here(tmp_path, Terrain(np.zeros((44, 44)), 0.1), request, chunk=64)
    found = find_reachable(prepared.store, 2.5, 2.5)
    assert found.start == (25, 25) and found.reached > found.cells
    assert found.distance[25, 35] == pytest.approx(1.0)
    assert found.distance[35, 35] == pytest.approx(np.sqrt(2.0))
    kept = zarr.open_group(prepared.store.path, mode="r", path=GROUP)
    told = {"from": [2.5, 2.5], "start": [25, 25], "farthest": list(found.farthest)}
    told |= {"cells": found.cells, "longest": found.longest, "chunks_finished": 1}
    assert told.items() <= dict(kept.attrs).items()
    distance = kept[DISTANCE][:]
    assert distance.tobytes() == found.distance[:].tobytes()
    assert found.cells == np.isfinite(distance).sum()
    assert not [path for path in prepared.store.path.iterdir() if path.name.startswith(".reach")]


def test_moves_lead_along_their_headings():
    found = {count: find_moves(count, CELL) for count in (1, 3, 8, 16, 24, 37, 64)}
    for headings, k in ((count, k) for count in found for k in range(count)):
        moves = found[headings]
        row, column = moves.steps[k, moves.counts[k] - 1]
        yaw = 2 * np.pi * k / headings
        off = (np.arctan2(row, column) - yaw + np.pi) % (2 * np.pi) - np.pi
        assert abs(off) <= 0.25 * 2 * np.pi / headings + 1e-9
        assert moves.lengths[k] == pytest.approx(CELL * np.hypot(row, column))
        steps = np.vstack([[0, 0], moves.steps[k, : moves.counts[k]]])
        assert np.abs(np.diff(steps, axis=0)).max() == 1
    assert (found[8].counts == 1).all()


def test_the_command_prints_area_and_longest_way_and_draws_them(tmp_path, capfd):
    request = make_request(headings=8)
    store = survey_here(tmp_path, Terrain(np.zeros((36, 70)), 0.1), request, chunk=64).store
    picture, tif = tmp_path / "area.png", tmp_path / "area.tif"
    words = ["reachable", str(store.path), "--from", "3,2", "--picture", str(picture)]
    assert main([*words, "--geotiff", str(tif)]) == 0
    report = json.loads(capfd.readouterr().out)
    area = find_reachable(store, 3.0, 2.0)
    assert report["cells"] == area.cells and report["turns"] == "assumed"
    assert report["area"] == pytest.approx(area.cells * store.notes.cell**2)
    assert report["longest"] == pytest.approx(area.longest, abs=1e-3)
    # At the edge the rover stands along it only, and it drives forwards only.
    assert report["cells_without_return"] == area.reached - area.cells > 0
    assert picture.stat().st_size > 10_000 and tif.stat().st_size > 100
    assert report["chunks_missing"] == 0
    (store.path / "seconds/c/0/1").unlink()
    assert main(words) == 0
    assert json.loads(capfd.readouterr().out)["chunks_missing"] == 1
    (store.path / "seconds/c/0/0").unlink()
    with pytest.raises(PlanningError, match="not surveyed yet"):
        find_reachable(store, 3.0, 2.0)


def test_a_start_where_the_rover_cannot_stand_says_why_and_one_that_is_no_place_is_refused(
    tmp_path, capfd
):
    elevation = np.zeros((60, 60))
    elevation[:, 30:] += 2.0 * 0.1 * np.arange(30)  # 63 degrees
    ground = Terrain(elevation, 0.1, (500_000.05, 4_999_993.05))  # as of a projection
    store = survey_here(tmp_path, ground, make_request()).store
    codes = json.loads((store.path / "zarr.json").read_text())["attributes"][NOTES]["limits"]
    first = codes[str(int(store.layer("first_limit")[30, 45]))]
    picture = tmp_path / "area.png"
    words = ["reachable", str(store.path), "--picture", str(picture), "--from"]
    assert main([*words, "500004.55,4999996.05"]) == 0 and picture.stat().st_size > 1000
    report = json.loads(capfd.readouterr().out)
    assert report["cells"] == 0 and first
    assert report["reason"] == f"no heading is passable at the start: {first}"
    assert main([*words, "500001.55,4999996.05"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert report["cells"] > 0 and report["reason"] == ""
    told = "x 500000.05 to 500005.95, y 4999993.05 to 4999998.95"
    with pytest.raises(PlanningError, match=rf"\(500000.123, 0\) is off the map.* within {told}"):
        find_reachable(store, 500_000.123, 0.0)
    assert_refused(capfd, main([*words, "nan,1"]), "--from is 'nan,1'; it must be two numbers")
