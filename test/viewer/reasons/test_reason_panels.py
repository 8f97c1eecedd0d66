# SPDX-License-Identifier: Apache-2.0
"""What the panels and the scene show of reasons: lanes, table, changes, board, scale, halos."""

import dataclasses
import itertools
import re

import numpy as np
import pytest

from rover_physics.names import WHEELS
from rover_planner.viewer.panel.board import FONT, BoardNotes, draw_board
from rover_planner.viewer.panel.candidate_table import draw_candidates
from rover_planner.viewer.panel.changes import draw_changes
from rover_planner.viewer.panel.lanes import BROKEN, COLOURS, WIDTH, draw_lanes
from rover_planner.viewer.panel.legend import draw_scale
from rover_planner.viewer.panel.plots import (
    MAX_POINTS,
    choose_rows,
)
from rover_planner.viewer.state import colours
from rover_planner.viewer.state.before_after import Difference
from rover_planner.viewer.state.candidate_rows import list_candidates
from rover_planner.viewer.state.colours import (
    MIN_CONTRAST,
    blend,
    choose_halo,
    find_contrast,
    map_colours,
)
from rover_planner.viewer.state.failure import explain
from rover_planner.viewer.state.layers import LAYERS, predict_layer
from rover_planner.viewer.state.path_limits import find_worst
from rover_planner.viewer.state.survey_layers import list_class_colours, list_limit_colours
from support.grounds import make_terrain, wall_at, waves
from support.viewer.sessions import LSR1, ramp, session_on

pytest.importorskip("trimesh", reason="no trimesh: pip install '.[view]'")

from rover_planner.viewer.scene.ground_mesh import (
    HATCH_SHADE,
    LINE_SHADE,
    build_ground_mesh,
)
from rover_planner.viewer.scene.link_outline import outline_link
from rover_planner.viewer.scene.overlays import FADE, WHITE


@pytest.fixture(scope="module")
def refused():
    """A session whose shown path is refused by a wheel that slips."""
    session = session_on(ramp)
    session.change_rover([("friction",)], 0.4)
    return session


# Lanes.


def test_lanes_have_a_strip_for_each_limit_that_is_broken_where_the_path_fails(refused):
    why = explain(refused.shown)
    drawing = draw_lanes(why.limits)
    for k, lane in enumerate(why.limits.lanes):
        assert f'y="{14 * k + 1}"' in drawing, lane.limit.title
    strips = re.findall(
        rf'x="([\d.]+)"[^>]*width="([\d.]+)"[^>]*fill="{COLOURS[BROKEN]}"', drawing
    )
    assert strips
    left, width = map(float, strips[-1])
    assert left <= WIDTH * why.failure.distance / why.limits.end <= left + width + 0.5
    assert why.failure.headline.split(",")[0] in drawing


# Tables.


def test_the_table_has_a_row_for_each_candidate_with_its_numbers_and_marks_the_shown_one():
    session = session_on(wall_at(0.5), goal=(1.5, 0.0, 0.0))
    rows = list_candidates(session.shown, False)
    text = draw_candidates(rows, 1)
    assert [int(n) for n in re.findall(r'<tbody data-say="show (\d)"', text)] == [1, 2, 3, 4, 5]
    for row in rows:
        assert (
            f"{row.driven:.2f} / {row.candidate.length:.2f}" in text
            and f"{row.energy:.1f}" in text
        )
    assert text.count("background:rgba(0,114,178") == 1
    marked = text[text.index("background:rgba(0") - 40 : text.index("background:rgba(0")]
    assert 'tbody data-say="show 2"' in marked and text.count('aria-selected="true"') == 1


def test_changes_are_listed_with_their_differences_and_what_stays_the_same_takes_no_place():
    same = Difference("time", "s", 10.0, 10.0, 1)
    changes = [same, Difference("energy", "J", 10.0, 12.5, 1)]
    text = draw_changes({"friction [-]": (0.8, 0.4)}, changes)
    assert "time" not in text
    assert "the drive is the same as before" in draw_changes({}, [same])
    for word in ("friction", "0.8", "0.4", "-0.4", "energy [J]", "10.0", "12.5", "+2.5"):
        assert f">{word}<" in text


# The board.


def test_the_board_shows_the_papers_traction_ratio_on_firm_ground_and_slip_on_soil(refused):
    state = refused.shown.trajectory.state_at(20.0)
    ratio = np.abs(state.tangential) / (state.friction * state.wheel_loads)
    firm = draw_board(LSR1, state, BoardNotes(has_slip=False))
    for value in ratio:
        assert f"<title>T/(&mu;N) {value:.2f}</title>" in firm
    assert "slip" not in firm
    assert "T/(&mu;N)" not in draw_board(LSR1, state, BoardNotes(has_slip=True))
    assert not refused.shown.trajectory.has_slip
    soft = session_on(waves)
    soft.change_options(soil="dry_sand")
    assert soft.shown.trajectory.has_slip


def test_the_board_outlines_the_link_that_fails_and_lists_the_worst_so_far(refused):
    why, trajectory = explain(refused.shown), refused.shown.trajectory
    worst = find_worst(why.limits, trajectory.duration)
    board = draw_board(LSR1, trajectory.state_at(trajectory.duration), BoardNotes(False, worst))
    assert f"{why.failure.value:.2f}max 1.00" in re.sub(r"<[^>]*>", "", board)
    sizes = [float(size) for size in re.findall(r'font-size="([\d.]+)"', board)]
    assert sizes and min(sizes) >= FONT == 12
    state = refused.shown.trajectory.state_at(20.0)
    for link in (*WHEELS, "body", "rocker_left", "bogie_right"):
        assert draw_board(LSR1, state, BoardNotes(failing=link)).count('data-failing="true"') == 1
    assert 'data-failing="true"' not in draw_board(LSR1, state, BoardNotes())


# The scene.


def test_every_link_has_an_outline_at_its_place(refused):
    state = refused.shown.trajectory.state_at(20.0)
    for k, wheel in enumerate(WHEELS):
        outline = outline_link(LSR1, state, wheel)
        np.testing.assert_allclose(
            outline[:64].reshape(-1, 3).mean(axis=0), state.wheel_centres[k], atol=0.01
        )
    for link in ("body", "rocker_left", "bogie_right"):
        outline = outline_link(LSR1, state, link)
        away = np.linalg.norm(outline.reshape(-1, 3) - state.position, axis=1)
        assert len(outline) and away.max() < 1.0
    assert len(outline_link(LSR1, state, "")) == 0


def ground_colours() -> set[tuple[int, int, int]]:
    """Return the colours that the ground can have on any layer, in all its shades.

    Also those of the layers of a survey, whose numbers have the same scale.
    """
    scale = {tuple(c) for c in map_colours(np.linspace(0.0, 1.0, 65), 0.0, 1.0).tolist()}
    names = ("GOOD", "BEYOND", "UNKNOWN", "PASSABLE", "REFUSED")
    scale |= {getattr(colours, name) for name in names}
    scale |= {*list_class_colours(), *list_limit_colours()}
    shades = np.linspace(0.3 * LINE_SHADE * HATCH_SHADE, 1.25, 12)
    return {
        tuple(np.minimum(np.multiply(colour, shade), 255).astype(int).tolist())
        for colour in scale
        for shade in shades
    }


def test_lines_stand_out_from_the_ground_on_every_layer():
    lines = (
        colours.PASSABLE,
        colours.REFUSED,
        colours.UNKNOWN,
        blend(colours.REFUSED, WHITE, FADE),
    )
    for line in lines:
        rings = [*choose_halo(line), line]
        for outer, inner in itertools.pairwise(rings):
            assert find_contrast(outer, inner) >= MIN_CONTRAST
        for ground in ground_colours():
            best = max(find_contrast(ground, ring) for ring in rings)
            assert best >= MIN_CONTRAST, (line, ground)


# Layers.


def test_layers_with_limits_have_them_on_their_scales_and_classes_have_a_legend():
    ground = make_terrain(waves, half=2.0)
    text = draw_scale("passable or not", build_ground_mesh(LSR1, ground, "passable or not").scale)
    for words in ("keeps all limits", "breaks a limit", "cannot stand"):
        assert words in text
    assert "gradient(90deg" not in text and "1.00" not in text
    for name, layer in LAYERS.items():
        scale = build_ground_mesh(LSR1, ground, name).scale
        assert (scale.limit is not None) == (layer.find_limit(LSR1) is not None)
        if scale.limit is not None:
            assert scale.low <= scale.limit <= scale.high
            text = draw_scale(name, scale)
            assert 'id="limit"' in text and f"limit {scale.limit:.2f}" in text


def test_ground_beyond_a_limit_is_vermillion_and_hatched():
    def picture(friction: float) -> np.ndarray:
        rover = dataclasses.replace(LSR1, friction=friction)
        mesh = build_ground_mesh(rover, make_terrain(lambda x, y: 0.35 * x, half=2.0),
                                 "friction utilisation")  # fmt: skip
        texture = np.asarray(mesh.mesh.visual.material.baseColorTexture).astype(float)
        return texture.reshape(-1, 3)

    slips, holds = picture(0.2), picture(2.0)
    is_red = (slips[:, 0] > 1.8 * slips[:, 1]) & (slips[:, 2] < 0.2 * slips[:, 0])
    assert is_red.mean() > 0.3
    assert not ((holds[:, 0] > 1.8 * holds[:, 1]) & (holds[:, 2] < 0.2 * holds[:, 0])).any()
    assert slips[is_red, 0].min() < 0.7 * slips[is_red, 0].max()


def test_a_layer_along_a_path_has_the_heading_of_its_nearest_waypoint():
    ground = make_terrain(lambda x, y: 0.2 * x + 0.1 * y, half=2.0)
    path = np.array([[-1.0, 0.0, 0.4], [1.0, 0.0, -1.1]])
    at = np.array([-0.6, 0.7]), np.array([0.2])
    tilt = LAYERS["torque saturation"]
    options = session_on(waves).scenario.asked_options.model
    along, _ = predict_layer(tilt, LSR1, ground, path, at, options)
    for column, yaw in enumerate((0.4, -1.1)):
        fixed, _ = predict_layer(tilt, LSR1, ground, yaw, at, options)
        assert along[0, column] == fixed[0, column]


def test_a_plot_keeps_first_and_last_point_and_every_peak():
    values = np.sin(np.linspace(0.0, 3.0, 1000))[:, None] * np.ones(6)
    values[437, 2], values[811, 4] = 9.0, -7.0
    rows = choose_rows(values)
    assert {0, 437, 811, 999} <= set(rows.tolist()) and len(rows) <= MAX_POINTS
    np.testing.assert_array_equal(choose_rows(values[:50]), np.arange(50))
