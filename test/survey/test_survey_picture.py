# SPDX-License-Identifier: Apache-2.0
"""The picture of a survey: its colours are those of the legend, whatever the shape of the map."""

import pytest

pytest.importorskip("zarr", reason="install the extra survey")
pytest.importorskip("matplotlib", reason="install the extra plots")

import matplotlib.image

from rover_planner.figures.survey_picture import choose_bar, draw_survey
from support.survey_maps import make_request, make_rough_map, survey_here


@pytest.mark.parametrize(("rows", "columns"), [(3, 200), (120, 3)])
def test_a_map_that_is_all_edge_has_the_colour_of_edges_and_no_legend_above_it(
    tmp_path, rows, columns
):
    store = survey_here(tmp_path / "out", make_rough_map(rows, columns), make_request()).store
    draw_survey(tmp_path / "p.png", store)
    pixels = matplotlib.image.imread(tmp_path / "p.png")
    is_edge = pixels[..., 2] - pixels[..., 0] > 0.03  # bluish, as unknown ground in the legend
    along = int(rows > columns)
    shares = is_edge.mean(axis=1 - along)
    assert shares.max() > 0.6  # a line of pixels along the map, from one end to the other


@pytest.mark.parametrize(("width", "length"), [(0.3999999999999999, 0.1), (13.0, 2.0), (1e6, 2e5)])
def test_the_scale_bar_has_a_round_length(width, length):
    assert choose_bar(width) == pytest.approx(length)
