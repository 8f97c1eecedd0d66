# SPDX-License-Identifier: Apache-2.0
"""Real ground: plains are passable; rims, gaps and the map's edge refused, each by its name."""

import numpy as np
import pytest

from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import hold_against_limits
from support.rough_grounds import quarter_turn

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
SLOPE_REASONS = {"friction", "tilt", "tip_over", "wheel_lift"}


@pytest.fixture(scope="module")
def mars_yard(real_map) -> Terrain:
    """Return the Mars Yard of the European Rover Challenge: craters, hills, stones."""
    return real_map("erc_marsyard2021_9cm")


@pytest.fixture(scope="module")
def gusev() -> Terrain:
    """Return the ground around Spirit on sol 1352: more than half of it unknown."""
    return load_terrain("spirit")


def straight(start, end, spacing=0.02) -> np.ndarray:
    """Return the poses of the straight way from start to end, nose ahead."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    count = int(np.ceil(np.linalg.norm(end - start) / spacing)) + 1
    yaw = np.arctan2(end[1] - start[1], end[0] - start[0])
    return np.column_stack([np.linspace(start, end, count), np.full(count, yaw)])


def verdict_of(ground, start, end, rover=LSR1, **arguments):
    return hold_against_limits(
        rover, judge_path(rover, ground, straight(start, end), SweepOptions(**arguments))[0]
    )


# The Mars Yard


@pytest.mark.parametrize(
    ("start", "end"),
    [((-2, -8), (-2, 12)), ((-18, -2), (-3, -2)), ((0, 3), (4, 3)), ((4, 3), (0, 3))],
)
def test_the_plain_of_the_mars_yard_is_traversable(mars_yard, start, end):
    verdict = verdict_of(mars_yard, start, end)
    assert verdict.traversable, verdict.reason
    assert verdict.max_tilt < np.radians(15.0)
    assert verdict.max_friction_utilisation < 0.6
    assert verdict.min_tip_over_ratio > 0.6


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ((12, 4), (12, 14)),  # up the hill
        ((-16, 7.5), (-10, 7.5)),  # down into the western crater
        ((-10, 0), (-10, 7)),  # over its southern rim
        ((-14, -11), (-13, -15)),  # a mound
    ],
)
def test_steep_ground_of_the_mars_yard_is_refused_for_the_physical_reason(mars_yard, start, end):
    verdict = verdict_of(mars_yard, start, end)
    assert not verdict.traversable
    assert verdict.code in SLOPE_REASONS, verdict.reason
    assert verdict.max_tilt > np.radians(28.0)


@pytest.mark.parametrize(("start", "end"), [((12, 4), (12, 14)), ((-16, 7.5), (-10, 7.5))])
def test_traction_control_gets_further_up_but_not_past_the_tilt(mars_yard, start, end):
    equal = verdict_of(mars_yard, start, end)
    optimal = verdict_of(mars_yard, start, end, policy="optimal")
    assert equal.code == "friction"
    assert optimal.code == "tilt"
    assert optimal.first_failure > equal.first_failure


@pytest.mark.parametrize(
    ("start", "end", "edge"),
    [((18, 2), (25, 2), 171), ((-2, 14), (-2, 20), 167), ((-15, 0), (-25, 0), 255)],
)
def test_a_path_over_the_edge_of_the_mars_yard_is_refused_as_off_the_map(
    mars_yard, start, end, edge
):
    verdict = verdict_of(mars_yard, start, end)
    assert verdict.code == "off_map"
    assert "map" in verdict.reason
    assert verdict.first_failure == pytest.approx(edge, abs=1)
    assert set(verdict.codes[verdict.first_failure :]) == {"off_map"}


def test_the_stones_of_the_mars_yard_are_too_high_for_the_belly_or_the_wheels(mars_yard):
    verdict = verdict_of(mars_yard, (-10.5, -8.0), (-6.5, -8.0))
    assert not verdict.traversable
    assert verdict.code in SLOPE_REASONS | {"belly", "wheel_drop", "suspension", "not_settled"}


def test_nearly_every_pose_of_the_mars_yard_settles(mars_yard):
    rng = np.random.default_rng(0)
    xmin, xmax, ymin, ymax = mars_yard.bounds
    places = rng.uniform([xmin + 1, ymin + 1], [xmax - 1, ymax - 1], (3000, 2))
    poses = np.column_stack([places, rng.uniform(-np.pi, np.pi, 3000)])
    assert judge_path(LSR1, mars_yard, poses)[0].settled.mean() >= 0.999


def test_a_quarter_turn_of_the_mars_yard_changes_no_verdict(mars_yard):
    for start, end in [((12, 4), (12, 14)), ((0, 3), (4, 3)), ((18, 2), (25, 2))]:
        ground, poses = quarter_turn(mars_yard, straight(start, end))
        turned = hold_against_limits(LSR1, judge_path(LSR1, ground, poses)[0])
        assert turned.code == verdict_of(mars_yard, start, end).code


# Spirit's surroundings


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ((-44.684, -19.499), (-47.58, -20.30)),
        ((-44.93, -20.544), (-44.0, -17.7)),
        ((-47.6, -20.85), (-44.83, -19.75)),
    ],
)
def test_known_ground_before_spirit_is_traversable(gusev, start, end):
    verdict = verdict_of(gusev, start, end)
    assert verdict.traversable, verdict.reason
    assert verdict.max_tilt < np.radians(15.0)


@pytest.mark.parametrize(
    ("start", "end"), [((-44.5, -19.5), (-44.5, -23.0)), ((-47.0, -20.2), (-47.0, -22.5))]
)
def test_a_path_from_known_into_unknown_ground_is_refused_as_such(gusev, start, end):
    verdict = verdict_of(gusev, start, end)
    assert verdict.code == "unknown_ground"
    assert "unknown" in verdict.reason
    assert verdict.first_failure > 40
    assert verdict.codes[0] == ""


def test_a_ridge_under_the_belly_is_refused_for_the_belly(gusev):
    verdict = verdict_of(gusev, (-42.307, -22.639), (-44.128, -21.814))
    assert verdict.code == "belly"
    assert verdict.first_failure > 20
