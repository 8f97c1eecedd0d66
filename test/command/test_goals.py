# SPDX-License-Identifier: Apache-2.0
"""Goals are chosen from the map: known ground to stand on, hard ground, and beyond the edge."""

import math

import numpy as np
import pytest

from rover_physics import Terrain, load_terrain
from rover_physics.rover.steering_joints import swing_radius
from rover_planner.demo.goals import choose_mission
from rover_planner.errors import PlanningError
from support.rovers import LSR1


def test_goals_are_what_they_say_and_plain_ones_and_the_start_stand_apart_on_known_ground():
    spirit, turn = load_terrain("spirit").fill_gaps(0.2), np.linspace(0.0, 2.0 * np.pi, 20)
    around = 0.5 * swing_radius(LSR1)
    for seed in (1, 2):
        mission = choose_mission(spirit, LSR1, seed)
        places = {goal.intent: goal.pose for goal in mission.goals}
        assert not spirit.contains(*places["off the map"][:2])
        unknown = places["unknown ground"][:2]
        assert spirit.contains(*unknown) and np.isnan(spirit.elevation_at(*unknown))
        assert np.isfinite(spirit.elevation_at(*places["steep"][:2]))
        line = np.linspace(mission.start[:2], places["rough"][:2], 200)
        assert np.isfinite(spirit.elevation_at(line[:, 0], line[:, 1])).all()
        plain = [goal.pose for goal in mission.goals if goal.intent == "plain"]
        assert len(plain) >= 2
        for x, y, _ in (mission.start, *plain):
            beneath = spirit.elevation_at(x + around * np.cos(turn), y + around * np.sin(turn))
            assert np.isfinite(beneath).all()
        away = [math.hypot(x - mission.start[0], y - mission.start[1]) for x, y, _ in plain]
        assert min(away) > 2.0 * swing_radius(LSR1)


def test_a_map_smaller_than_the_rover_is_refused():
    mission = choose_mission(Terrain(np.zeros((40, 40)), 0.05), LSR1)
    level = {goal.intent for goal in mission.goals}
    assert "off the map" in level and "unknown ground" not in level
    with pytest.raises(PlanningError, match="no place"):
        choose_mission(Terrain(np.zeros((8, 8)), 0.1), LSR1)
