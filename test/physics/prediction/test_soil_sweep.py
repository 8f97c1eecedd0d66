# SPDX-License-Identifier: Apache-2.0
"""Soil in the sweep: slip, sinkage, torque and verdict where the ground yields."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, Terrain, judge_path
from rover_physics.errors import SoilError
from rover_physics.rover.model import Part
from rover_physics.terrain.soil_file import load_soils
from rover_physics.traversability.verdict import hold_against_limits
from support.rough_grounds import plane, random_poses, smooth
from support.rover_geometry import turned_round
from support.rovers import LSR1

POSE = [[0.0, 0.0, 0.0]]
AHEAD = np.column_stack([np.linspace(-0.5, 0.5, 51), np.zeros(51), np.zeros(51)])
ON_SOIL = (
    "torque", "friction", "friction_utilisation", "slip_ratio", "torque_saturation", "sinkage",
    "motion_resistance",
)  # fmt: skip


def with_soil(ground: Terrain, *names: str, index=0) -> Terrain:
    soil = np.broadcast_to(np.asarray(index, dtype=np.int32), ground.elevation.shape)
    return replace(ground, soil=np.ascontiguousarray(soil), soil_names=names)


def bekker_wong(name: str, N: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sinkage [m], resistance and largest thrust [N] by the formulas of docs/soil.md."""
    soil, r, b = load_soils()[name], LSR1.wheel.radius, LSR1.wheel.width
    stiffness = soil.k_c + b * soil.k_phi
    sinkage = (3.0 * N / ((3.0 - soil.n) * stiffness * np.sqrt(2.0 * r))) ** (
        2.0 / (2.0 * soil.n + 1.0)
    )
    resistance = stiffness * sinkage ** (soil.n + 1.0) / (soil.n + 1.0)
    length = r * np.arccos(1.0 - sinkage / r)
    strength = b * length * soil.cohesion + N * np.tan(soil.friction_angle)
    x = length / soil.shear_modulus
    return sinkage, resistance, strength * (1.0 - (1.0 - np.exp(-x)) / x)


@pytest.mark.parametrize(("soil", "policy"), [("lunar_nominal", "equal"), ("dry_sand", "optimal")])
def test_every_wheel_obeys_the_formulas_under_its_own_load(soil, policy):
    prediction = judge_path(
        LSR1, smooth(2), random_poses(3, 4, 0.6), SweepOptions(soil=soil, policy=policy)
    )[0]
    sinkage, resistance, largest = bekker_wong(soil, prediction.wheel_loads)
    assert prediction.sinkage == pytest.approx(sinkage, rel=1e-9)
    assert prediction.motion_resistance == pytest.approx(resistance, rel=1e-9)
    pull = (largest - resistance) / prediction.wheel_loads
    assert prediction.friction == pytest.approx(np.maximum(pull, 1e-3), rel=1e-9)
    thrust = prediction.tangential + resistance
    assert prediction.torque == pytest.approx(LSR1.wheel.radius * thrust, rel=1e-9)
    assert prediction.torque_saturation == pytest.approx(np.abs(prediction.torque) / 2.0)


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


def test_a_coulomb_soil_is_as_its_friction_without_a_soil():
    ground, poses = smooth(4), random_poses(4, 5, 0.6)
    soil, plain = (
        judge_path(LSR1, ground, poses, replace(options, policy="optimal"))[0]
        for options in (
            SweepOptions(soil="firm_ground", friction=0.3), SweepOptions(friction=0.8)
        )
    )  # fmt: skip
    for name in ("wheel_loads", "torque", "friction", "friction_utilisation", "slip_ratio"):
        assert getattr(soil, name) == pytest.approx(getattr(plain, name), abs=1e-3), name
    assert not (soil.sinkage.any() or plain.sinkage.any() or plain.motion_resistance.any())


def test_optimal_torques_keep_the_limit_with_the_resistance():
    ground, options = plane(0.1, 0.12), SweepOptions(soil="lunar_nominal", policy="optimal")
    limit = 0.97 * judge_path(LSR1, ground, POSE, options)[0].torque.max()
    bound = judge_path(LSR1, ground, POSE, replace(options, max_torque=limit))[0]
    assert bound.torque_saturation.max() <= 1.0 + 1e-3


def test_a_wheel_that_sinks_too_deep_for_the_model_is_refused_as_such():
    heavy = replace(LSR1, masses=replace(LSR1.masses, body=Part(60.0, (0.0, 0.0, 0.05))))
    prediction = judge_path(heavy, plane(0.0, 0.0), POSE, SweepOptions(soil="mars_simulant"))[0]
    verdict = hold_against_limits(heavy, prediction)
    assert prediction.sinkage.max() > 0.2 / 6.0 and verdict.code == "sinkage"
    assert "wheel sinks deeper" in verdict.reason and "limit 0.033 m" in verdict.reason


def test_a_soil_without_a_name_among_the_presets_is_refused():
    with pytest.raises(SoilError, match="no soil 'dry_sad'"):
        judge_path(LSR1, plane(0.0, 0.0), POSE, SweepOptions(soil="dry_sad"))[0]
    with pytest.raises(SoilError, match="no soil 'gravy'"):
        judge_path(LSR1, with_soil(plane(0.0, 0.0), "gravy"), POSE)[0]


@pytest.mark.parametrize(("soil", "policy"), [(None, "equal"), ("dry_sand", "optimal")])
def test_up_a_slope_backwards_is_as_forwards_of_the_rover_turned_round(soil, policy):
    ground, poses, options = plane(0.1, 0.05), AHEAD[::25], SweepOptions(policy, soil=soil)
    there = poses + np.array([0.0, 0.0, np.pi])
    back = judge_path(LSR1, ground, there, replace(options, backward=True))[0]
    ahead = judge_path(turned_round(LSR1), ground, poses, options)[0]
    other = [5, 4, 3, 2, 1, 0]
    assert back.torque == pytest.approx(-ahead.torque[:, other], abs=2e-3)
    assert back.slip_ratio == pytest.approx(ahead.slip_ratio[:, other], abs=5e-3)
    assert back.energy == pytest.approx(ahead.energy, rel=1e-2)
    assert back.energy[-1] > 1.0
