# SPDX-License-Identifier: Apache-2.0
"""Real ground: plains are passable; rims and ridges refused, each by its name."""

import numpy as np
import pytest

from rover_physics import SweepOptions, Terrain, judge_path, load_rover, load_terrain
from rover_physics.traversability.verdict import hold_against_limits

LSR1 = load_rover("lsr1")
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
    ("start", "end"), [((-2, -8), (-2, 12)), ((-18, -2), (-3, -2)), ((4, 3), (0, 3))]
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


# Spirit's surroundings


def test_known_ground_before_spirit_is_traversable(gusev):
    verdict = verdict_of(gusev, (-44.684, -19.499), (-47.58, -20.30))
    assert verdict.traversable, verdict.reason
    assert verdict.max_tilt < np.radians(15.0)


def test_a_ridge_under_the_belly_is_refused_for_the_belly(gusev):
    verdict = verdict_of(gusev, (-42.307, -22.639), (-44.128, -21.814))
    assert verdict.code == "belly"
    assert verdict.first_failure > 20
