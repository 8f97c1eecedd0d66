# SPDX-License-Identifier: Apache-2.0
"""Drops: a wheel that rolls off an edge falls by its height, and no slope counts as an edge."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.prediction.drops import FACE
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.judge import judge_path
from rover_physics.traversability.verdict import Verdict, hold_against_limits
from support.reference_drives import drive_ground, drive_path, unlimited
from support.rough_grounds import plane

LSR1 = load_rover("lsr1")
FREE = unlimited(LSR1)
RADIUS = LSR1.wheel.radius
SLIPPERY = 0.27
"""Friction that holds a wheel up to 15 degrees: it falls from the edge almost at once."""


def edge_down(height: float) -> Terrain:
    """Return a step of `height` [m] that goes down along +x."""
    up = drive_ground("step", height)
    return Terrain(height - up.elevation, up.resolution, up.origin)


def drive(
    ground: Terrain, rover: Rover = FREE, spacing: float = 0.01, **options
) -> tuple[PathPrediction, Verdict]:
    prediction = judge_path(rover, ground, drive_path(spacing), SweepOptions(**options))[0]
    return prediction, hold_against_limits(rover, prediction)


def with_drop_limit(limit: float) -> Rover:
    return replace(FREE, limits=replace(FREE.limits, wheel_drop=limit))


@pytest.mark.parametrize("height", [0.05, 0.1, 0.2])
def test_a_wheel_rolls_over_an_edge_and_drops_by_the_rest_of_its_height(height):
    """It rolls until the forces do not balance, at most until the edge is a face below it."""
    rolled = RADIUS * (1.0 - np.cos(FACE))
    prediction, _ = drive(edge_down(height), friction=SLIPPERY)
    drops = prediction.wheel_drop.max(axis=0)
    assert (drops <= height + 1e-3).all()
    assert (drops >= height - rolled - 1e-3).all()


@pytest.mark.parametrize("height", [0.1, 0.2])
def test_with_more_friction_a_wheel_never_drops_deeper(height):
    drops = [
        drive(edge_down(height), friction=mu)[0].wheel_drop.max(axis=0)
        for mu in (0.27, 0.4, 0.6, 0.8, 1.0)
    ]
    assert (np.diff(drops, axis=0) <= 1e-9).all()


@pytest.mark.parametrize("friction", [0.2, 1.5])
@pytest.mark.parametrize("policy", ["equal", "servo", "optimal"])
def test_no_friction_hides_a_fall_from_a_wall_that_is_too_high(friction, policy):
    """Too high is the limit and what a wheel rolls over the edge before it falls."""
    rolled = RADIUS * (1.0 - np.cos(FACE))
    down = edge_down(LSR1.limits.wheel_drop + rolled + 5e-3)
    _, verdict = drive(down, LSR1, friction=friction, policy=policy)
    assert not verdict.traversable
    assert "wheel_drop" in verdict.codes


def test_a_drop_does_not_depend_on_where_waypoints_are():
    moved = [drive_path(0.02) + np.array([x, 0.0, 0.0]) for x in (0.0, 0.004, 0.009, 0.015)]
    drops = [
        judge_path(FREE, edge_down(0.15), path, SweepOptions(friction=0.8))[0].wheel_drop.max(
            axis=0
        )
        for path in moved
    ]
    assert np.ptp(drops, axis=0).max() < 1e-3


@pytest.mark.parametrize("friction", [0.2, 0.3, 0.6])
@pytest.mark.parametrize("policy", ["equal", "optimal"])
def test_a_wheel_rolls_down_a_smooth_bump_however_slippery_if_the_others_hold_it(friction, policy):
    ground = plane(0.0, 0.0, half=3.0)
    y, x = (ground.origin[k] + ground.resolution * np.arange(n) for k, n in ((1, 301), (0, 301)))
    wave = 0.14 * np.cos(np.pi * x / 0.8) ** 2 * (np.abs(x) < 0.4)
    bump = replace(ground, elevation=(y > 0.0)[:, None] * wave)
    _, verdict = drive(bump, LSR1, friction=friction, policy=policy)
    assert verdict.traversable and verdict.max_wheel_drop == 0.0


def test_a_drop_is_told_where_the_wheel_lands():
    prediction, _ = drive(edge_down(0.15))
    for name, wheel in (("rear", 0), ("middle", 1), ("front", 2)):
        where = prediction.poses[prediction.wheel_drop[:, wheel].argmax(), 0]
        assert 0.0 < where + LSR1.suspension.wheels[name][0] <= 2.0 * RADIUS


def test_a_drop_beyond_the_limit_is_refused_by_its_own_code():
    ground = edge_down(0.15)
    _, allowed = drive(ground, with_drop_limit(0.16))
    _, refused = drive(ground, with_drop_limit(0.05))
    assert allowed.traversable
    assert not refused.traversable and set(refused.codes) == {"", "wheel_drop"}
    assert "drops off an edge" in refused.reason and "limit 0.050 m" in refused.reason
    assert refused.max_wheel_drop == allowed.max_wheel_drop


def test_while_a_wheel_falls_neither_friction_nor_torque_are_asked_for():
    prediction, verdict = drive(edge_down(0.2), friction=0.4)
    needed = prediction.friction_utilisation[prediction.falling.any(axis=1)]
    assert len(needed) and needed.max() > 1.0
    assert verdict.traversable and verdict.max_friction_utilisation < 1.0


def test_up_a_step_no_wheel_drops():
    for height in (0.05, 0.15):
        prediction, _ = drive(drive_ground("step", height))
        assert not prediction.wheel_drop.any() and not prediction.falling.any()


def test_into_a_ditch_the_wheels_drop_and_have_to_climb_out():
    prediction, verdict = drive(drive_ground("ditch", 0.3), friction=0.8, policy="optimal")
    assert (prediction.wheel_drop.max(axis=0) > 0.1).all()
    assert np.degrees(prediction.between.contact_angle).max() > 70.0
    assert verdict.max_wheel_drop <= 0.15 + 1e-3


@pytest.mark.parametrize("slope", [0.2, 0.5, 0.7])
def test_a_long_slope_is_not_a_drop(slope):
    prediction, _ = drive(plane(-slope, 0.0, half=2.0))
    assert not prediction.falling.any() and not prediction.wheel_drop.any()


@pytest.mark.parametrize("degrees", [10.0, 25.0, 35.0])
def test_the_crest_of_a_slope_is_not_an_edge(degrees):
    level = plane(0.0, 0.0, half=2.2)
    x = level.origin[0] + level.resolution * np.arange(level.elevation.shape[1])
    fall = np.where(x > 0.0, -np.tan(np.radians(degrees)) * x, 0.0)
    prediction, _ = drive(replace(level, elevation=np.broadcast_to(fall, level.elevation.shape)))
    assert not prediction.wheel_drop.any()


def test_a_slope_too_slippery_to_stand_on_is_refused_for_friction_and_not_a_fall():
    prediction, verdict = drive(plane(-0.5, 0.0, half=2.0), friction=0.3)
    assert verdict.code == "friction" and not prediction.wheel_drop.any()
