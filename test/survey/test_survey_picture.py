# SPDX-License-Identifier: Apache-2.0
"""The picture of a survey: its colours are those of the legend, whatever the shape of the map."""

import pytest

pytest.importorskip("zarr", reason="install the extra survey")
pytest.importorskip("matplotlib", reason="install the extra plots")

import matplotlib.image
import numpy as np

from rover_planner.figures.survey_picture import choose_bar, draw_reachable, draw_survey
from rover_planner.survey.reachable import find_reachable
from support.survey_maps import make_request, make_rough_map, survey_here


def find_unknown_colour(picture) -> np.ndarray:
    """Return where a picture is bluish, as the legend's entry of unknown ground and edges."""
    pixels = matplotlib.image.imread(picture)
    return np.asarray(pixels[..., 2] - pixels[..., 0] > 0.03)


@pytest.mark.parametrize(("rows", "columns"), [(3, 200), (120, 3)])
def test_a_map_that_is_all_edge_has_the_colour_of_edges_and_no_legend_above_it(
    tmp_path, rows, columns
):
    store = survey_here(tmp_path / "out", make_rough_map(rows, columns), make_request()).store
    draw_survey(tmp_path / "p.png", store)
    is_edge = find_unknown_colour(tmp_path / "p.png")
    along = int(rows > columns)
    shares = is_edge.mean(axis=1 - along)
    assert shares.max() > 0.6  # a line of pixels along the map, from one end to the other


def test_a_start_without_ways_is_drawn(tmp_path):
    store = survey_here(tmp_path / "out", make_rough_map(20, 20), make_request()).store
    area = find_reachable(store, *store.notes.frame.origin)
    assert area.cells == 0
    draw_reachable(tmp_path / "p.png", store, area)
    assert (tmp_path / "p.png").stat().st_size > 1000


@pytest.mark.parametrize(("width", "length"), [(0.3999999999999999, 0.1), (13.0, 2.0), (1e6, 2e5)])
def test_the_scale_bar_has_a_round_length(width, length):
    assert choose_bar(width) == pytest.approx(length)
