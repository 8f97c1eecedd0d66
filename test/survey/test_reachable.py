"""What can be reached on a surveyed map, and returned from, agrees with scipy's graphs."""

import json

import numpy as np
import pytest

pytest.importorskip("zarr", reason="install the extra survey")
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from rover_physics.terrain.grid import Terrain
from rover_planner.cli import main
from rover_planner.errors import PlanningError
from rover_planner.survey.layers import unpack_bits
from rover_planner.survey.moves import find_moves
from rover_planner.survey.reachable import find_reachable, search_area
from support.survey_maps import make_request, make_rough_map, survey_here

CELL = 0.25


def graph_of(passable, turnable, headings):
    """Return the graph of nodes (row, column, heading) with all moves and turns, for scipy."""
    moves = find_moves(headings, CELL)
    may, turns = unpack_bits(passable, headings), unpack_bits(turnable, headings)
    rows, columns = passable.shape
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
    at = [np.ravel_multi_index(np.array([edge[e] for edge in edges]).T, (rows, columns, headings))
          for e in (0, 1)]  # fmt: skip
    # Explicit zeros are edges for scipy's sparse graphs.
    return csr_array((np.array(list(edges.values())), (at[0], at[1])), shape=(size, size))


@pytest.mark.parametrize("headings", [1, 4, 8, 12, 16])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_ways_are_the_shortest_of_the_graph_and_lead_back(headings, seed):
    rng = np.random.default_rng(seed)
    kind = np.uint64
    open_at = rng.random((22, 25, headings)) < 0.85
    start = (11, 12)
    open_at[start] = True
    turns_at = open_at & (rng.random(open_at.shape) < 0.7)
    places = np.arange(headings).astype(kind)
    passable, turnable = (
        np.bitwise_or.reduce(np.where(one, kind(1) << places, kind(0)), axis=2)
        for one in (open_at, turns_at)
    )
    area = search_area(passable, turnable, find_moves(headings, CELL), start, CELL)
    graph = graph_of(passable, turnable, headings)
    nodes = [np.ravel_multi_index((*start, k), open_at.shape)
             for k in range(headings) if open_at[(*start, k)]]  # fmt: skip
    out = dijkstra(graph, indices=nodes, min_only=True)
    back = dijkstra(graph.T, indices=nodes, min_only=True)
    wanted = np.where(np.isfinite(back), out, np.inf).reshape(open_at.shape).min(axis=2)
    np.testing.assert_allclose(area.distance, wanted, rtol=1e-5)
    assert area.reached == np.isfinite(out).reshape(open_at.shape).any(axis=2).sum()
    assert headings < 8 or area.cells > 20


@pytest.mark.parametrize("headings", range(1, 65))
def test_moves_lead_along_their_headings(headings):
    moves = find_moves(headings, CELL)
    for k in range(headings):
        row, column = moves.steps[k, moves.counts[k] - 1]
        yaw = 2 * np.pi * k / headings
        off = (np.arctan2(row, column) - yaw + np.pi) % (2 * np.pi) - np.pi
        assert abs(off) <= 0.25 * 2 * np.pi / headings + 1e-9
        assert moves.lengths[k] == pytest.approx(CELL * np.hypot(row, column))
        steps = np.vstack([[0, 0], moves.steps[k, : moves.counts[k]]])
        assert np.abs(np.diff(steps, axis=0)).max() == 1
    if headings == 8:
        assert (moves.counts == 1).all()


def test_a_wall_bounds_what_can_be_reached_and_a_step_has_no_return(tmp_path):
    heights = np.zeros((70, 90))
    heights[:, 60:62] = 1.0
    store = survey_here(tmp_path, Terrain(heights, 0.1), make_request(headings=8)).store
    area = find_reachable(store, 3.0, 3.5)
    assert area.start == (35, 30) and area.cells > 1000
    assert np.isinf(area.distance[:, 60:]).all()
    assert area.distance[35, 40] == pytest.approx(1.0)
    assert area.distance[45, 40] == pytest.approx(np.sqrt(2.0))
    assert area.area == pytest.approx(area.cells * 0.01)
    beyond = find_reachable(store, 7.5, 3.5)
    assert beyond.cells > 100 and np.isinf(beyond.distance[:, :60]).all()


def test_judged_turns_bound_the_area(tmp_path):
    terrain = make_rough_map(100, 100)
    areas = []
    for turns in (False, True):
        request = make_request(headings=8, turns=turns)
        prepared = survey_here(tmp_path / str(turns), terrain, request)
        areas.append(find_reachable(prepared.store, 1202.5, -337.5))
    assumed, judged = (np.isfinite(area.distance) for area in areas)
    assert judged.sum() < assumed.sum() and not (judged & ~assumed).any()


def test_a_start_where_the_rover_cannot_stand_reaches_nothing(tmp_path):
    heights = np.zeros((60, 60))
    store = survey_here(tmp_path, Terrain(heights, 0.1), make_request(headings=8)).store
    area = find_reachable(store, 0.0, 0.0)
    assert area.cells == 0 and area.farthest is None
    with pytest.raises(PlanningError, match=r"from \(99, 0\) is off the map; .* x 0 to 5.9"):
        find_reachable(store, 99.0, 0.0)


def test_the_command_prints_area_and_longest_way_and_draws_them(tmp_path, capfd):
    store = survey_here(tmp_path, Terrain(np.zeros((60, 70)), 0.1), make_request(headings=8)).store
    picture, tif = tmp_path / "area.png", tmp_path / "area.tif"
    words = ["reachable", str(store.path), "--from", "3,3", "--picture", str(picture)]
    assert main([*words, "--geotiff", str(tif)]) == 0
    report = json.loads(capfd.readouterr().out)
    area = find_reachable(store, 3.0, 3.0)
    assert report["cells"] == area.cells and report["turns"] == "assumed"
    assert report["longest"] == pytest.approx(float(area.distance[area.farthest]), abs=1e-3)
    # At the edge the rover stands along it only, and it drives forwards only.
    assert report["cells_without_return"] == area.reached - area.cells > 0
    assert picture.stat().st_size > 10_000 and tif.stat().st_size > 100


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nothing", "--from", "1,1"], "no survey nothing"),
        (["nothing", "--from", "1"], "--from is '1'; it must be two numbers"),
        (["nothing", "--from", "nan,1"], "--from is 'nan,1'"),
        (["nothing"], "--from"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(words, said, capfd):
    assert main(["reachable", *words]) == 2
    err = capfd.readouterr().err
    assert said in err and err.count("\n") == 1
