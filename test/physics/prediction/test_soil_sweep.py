# SPDX-License-Identifier: Apache-2.0
"""Soil in the sweep: slip, sinkage, torque and verdict where the ground yields."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, Terrain, judge_path
from rover_physics.forces.soil import SoilWheel, effective_friction, pack_soils, solve_wheel
from support.grounds import plane, random_poses, smooth
from support.paths import poses_at
from support.rover_geometry import turned_round
from support.rovers import LSR1

POSE = [[0.0, 0.0, 0.0]]
FORCES = ("wheel_loads", "tangential", "lateral")
ON_SOIL = (
    "torque", "friction", "friction_utilisation", "slip_ratio", "torque_saturation", "sinkage",
    "motion_resistance",
)  # fmt: skip


def with_soil(ground: Terrain, *names: str, index=0) -> Terrain:
    soil = np.broadcast_to(np.asarray(index, dtype=np.int32), ground.elevation.shape)
    return replace(ground, soil=np.ascontiguousarray(soil), soil_names=names)


@pytest.mark.parametrize(
    ("soil", "policy"), [(None, "equal"), ("lunar_nominal", "equal"), ("dry_sand", "optimal")]
)
def test_every_wheel_obeys_the_model_of_its_soil_under_its_own_load(soil, policy):
    options = SweepOptions(soil=soil, policy=policy)
    prediction = judge_path(LSR1, smooth(2), random_poses(3, 4, 0.6), options)[0]
    wheel = SoilWheel(LSR1.wheel.radius, LSR1.wheel.width, 0.8)
    ground = pack_soils(default=soil)[0]
    for place in np.ndindex(4, 6):
        at = {name: float(getattr(prediction, name)[place]) for name in (*FORCES, *ON_SOIL)}
        found = solve_wheel(ground, wheel, *(at[name] for name in FORCES))
        assert at["sinkage"] == pytest.approx(found.sinkage, rel=1e-9)
        assert at["motion_resistance"] == pytest.approx(found.resistance, rel=1e-9)
        assert at["slip_ratio"] == pytest.approx(found.slip_ratio, abs=1e-9)
        assert at["friction_utilisation"] == pytest.approx(found.utilisation, rel=1e-9)
        friction = effective_friction(ground, wheel, at["wheel_loads"])
        assert at["friction"] == pytest.approx(friction, rel=1e-9)
        assert at["torque"] == pytest.approx(found.torque, rel=1e-9)
        assert at["torque_saturation"] == pytest.approx(abs(at["torque"]) / 2.0)


def test_soil_in_some_cells_changes_the_wheels_on_them_alone():
    ground = plane(0.05, 0.0)
    rows = np.arange(ground.elevation.shape[0])[:, None]
    left = np.where(rows > rows.mean(), 0, -1)
    half = judge_path(LSR1, with_soil(ground, "dry_sand", index=left), POSE)[0]
    firm, sand = (
        judge_path(LSR1, ground, POSE, SweepOptions(soil=soil))[0] for soil in (None, "dry_sand")
    )
    for name in ("wheel_loads", "tangential", "lateral", "tip_over_ratio"):
        assert getattr(half, name).tobytes() == getattr(firm, name).tobytes(), name
    for name in ON_SOIL:
        found = getattr(half, name)[0]
        assert found[:3] == pytest.approx(getattr(firm, name)[0, :3]), name
        assert found[3:] == pytest.approx(getattr(sand, name)[0, 3:]), name
        assert found[3] != found[0], name


@pytest.mark.parametrize("policy", ["optimal", "servo"])
def test_a_coulomb_soil_is_as_its_friction_without_a_soil(policy):
    ground, poses = smooth(4), random_poses(4, 5, 0.6)
    soil, plain = (
        judge_path(LSR1, where, poses, SweepOptions(policy, friction=friction))[0]
        for where, friction in ((with_soil(ground, "firm_ground"), 0.3), (ground, 0.8))
    )
    for name in ("wheel_loads", "torque", "friction", "friction_utilisation", "slip_ratio"):
        assert getattr(soil, name) == pytest.approx(getattr(plain, name), abs=1e-3), name
    assert not (soil.sinkage.any() or plain.sinkage.any() or plain.motion_resistance.any())


def test_optimal_torques_keep_the_limit_with_the_resistance():
    ground, options = plane(0.1, 0.12), SweepOptions(soil="lunar_nominal", policy="optimal")
    limit = 0.97 * judge_path(LSR1, ground, POSE, options)[0].torque.max()
    bound = judge_path(LSR1, ground, POSE, replace(options, max_torque=limit))[0]
    assert bound.torque_saturation.max() <= 1.0 + 1e-3


def test_up_a_slope_backwards_is_as_forwards_of_the_rover_turned_round():
    ground, options = plane(0.1, 0.05), SweepOptions("optimal", soil="dry_sand")
    poses, there = (poses_at([-0.5, 0.0, 0.5], yaw=yaw) for yaw in (0.0, np.pi))
    back = judge_path(LSR1, ground, there, replace(options, backward=True))[0]
    ahead = judge_path(turned_round(LSR1), ground, poses, options)[0]
    other = [5, 4, 3, 2, 1, 0]
    assert back.torque == pytest.approx(-ahead.torque[:, other], abs=2e-3)
    assert back.slip_ratio == pytest.approx(ahead.slip_ratio[:, other], abs=5e-3)
    assert back.energy == pytest.approx(ahead.energy, rel=1e-2)
    assert back.energy[-1] > 1.0
