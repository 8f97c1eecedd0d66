# SPDX-License-Identifier: Apache-2.0
"""Tests of turned wheels on the page."""

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_planner.planning.path_query import check_path
from rover_planner.viewer.panel.dashboard import draw_dashboard
from rover_planner.viewer.state.trajectory import Trajectory, find_axles
from support.grounds import make_terrain, waves


def arc(radius, length=1.0, count=41):
    turned = np.linspace(0.0, length / radius, count)
    x, y = radius * np.sin(turned), radius * (1.0 - np.cos(turned))
    return np.column_stack([x, y, turned])


def drive(poses, ground=lambda x, y: 0.0 * x):
    rover = load_rover("lsr1")
    candidate = check_path(rover, make_terrain(ground, half=4.0), poses)
    trajectory = Trajectory(rover, candidate.prediction, candidate.verdict)
    return rover, trajectory.state_at(0.5 * trajectory.duration)


def test_the_axles_are_those_of_the_model_on_rough_ground():
    rover, state = drive(arc(1.0), waves)
    outwards = state.wheel_centres - state.contact_points
    away = np.abs((outwards * find_axles(rover, state)).sum(axis=1))
    assert (away <= 0.5 * rover.wheel.width + 1e-6).all()
    radial = np.sqrt((outwards**2).sum(axis=1) - away**2)
    assert radial == pytest.approx(np.full(6, rover.wheel.radius), abs=2e-3)


def test_the_dashboard_shows_turned_wheels_to_the_left_for_positive_angles():
    rover, state = drive(arc(0.8))
    text = draw_dashboard(rover, state, "paused")
    front_left = np.degrees(state.steering_angle[5])
    assert front_left > 20.0
    assert f"rotate({-front_left:.1f} " in text and f"turned {front_left:.0f} deg" in text
