# SPDX-License-Identifier: Apache-2.0
"""Chances of failure: what is told, what is common, what decides, and what drives say."""

import re
from dataclasses import fields, replace
from statistics import NormalDist

import numpy as np
import pytest

from benchmarks.chance import HELD_OUT, find_chance, read_driven_paths
from rover_physics import SweepOptions, Terrain, judge_path, judge_poses, load_rover
from rover_physics.chance import failure_chance
from rover_physics.chance.failure_chance import EVEN_SHARE, PLACES, SAMPLES, FailureChance
from rover_physics.chance.samples import DEVIATES, draw_samples
from rover_physics.errors import ModelError
from rover_physics.limits.table import CHANCE
from rover_physics.rover.uncertainty import Uncertainty
from rover_physics.traversability.verdict import refuse_chance
from support.grounds import make_terrain, plane, rocky, with_std
from support.paths import poses_at
from support.project.checkout import TOP
from support.reference_drives import drive_ground, drive_path, unlimited

EXACT = Uncertainty(**{one.name: 0.0 for one in fields(Uncertainty)})
FRICTION = 0.5
SLIPPERY = SweepOptions(friction=FRICTION)
DOCS = TOP / "docs" / "uncertainty.md"
ONE = 1.5 / SAMPLES
"""A sample and a half: what the samples may miss of a chance."""


def rover_with(**uncertainty: float):
    return replace(unlimited(load_rover("lsr1")), uncertainty=replace(EXACT, **uncertainty))


def straight(n: int) -> np.ndarray:
    return poses_at(np.linspace(-0.2, 0.2, n))


def chance_on(ground: Terrain, rover, options=SLIPPERY, n: int = 5):
    return judge_path(rover, ground, straight(n), options, accepted_chance=1.0)[1]


def chance_near_torque(ground: Terrain, rover, use: float = 0.9) -> float:
    """Return the chance on ground that grips, with motors of which a share is used."""
    used = chance_on(ground, rover).max_torque_saturation * rover.wheel.max_torque
    options = SweepOptions(friction=1.5, max_torque=used / use)
    return chance_on(ground, rover, options).failure_chance


@pytest.mark.parametrize("slope", [0.26, 0.3, 0.33])
def test_the_chance_is_that_of_a_friction_below_what_the_slope_needs_all_along_a_path(slope):
    found = chance_on(plane(slope, 0.0), rover_with(friction=0.1), n=40)
    expected = NormalDist(1.0, 0.1).cdf(found.max_friction_utilisation)
    assert 0.005 < expected < 0.995
    assert found.failure_chance == pytest.approx(expected, abs=ONE)
    assert set(found.failure_chance_at) == {found.failure_chance}


@pytest.mark.parametrize(("policy", "slope"), [("equal", 0.4), ("servo", 0.72), ("optimal", 0.72)])
def test_the_friction_of_a_coulomb_soil_is_as_uncertain_as_any(policy, slope):
    ground, rover = plane(slope, 0.0), rover_with(friction=0.1)
    on_soil, told = (
        chance_on(ground, rover, SweepOptions(policy, **options)).failure_chance
        for options in ({"soil": "firm_ground"}, {"friction": 0.8})
    )
    assert 0.1 < on_soil == told < 1.0


def test_samples_over_the_error_of_the_model_are_spread_as_told():
    told = Uncertainty()
    groups = draw_samples(told, SAMPLES, PLACES)
    samples = [one.add_error(1.0) for group in groups for one in group.samples]
    frictions, torques = [one.friction.mean() for one in samples], [one.torque for one in samples]
    of_friction = np.hypot(told.friction, told.friction_per_wheel / np.sqrt(6.0))
    over = np.hypot(told.model, told.wheel_radius)
    for ratios, own, other in (
        (frictions, of_friction, told.model),
        (torques, told.max_torque, over),
    ):
        below = [NormalDist(1.0 - x, np.hypot(own, x * other)).cdf(0.0) for x in sorted(ratios)]
        steps = np.arange(SAMPLES + 1) / SAMPLES
        assert np.abs(below - steps[:-1]).max() < 0.1
        assert np.abs(below - steps[1:]).max() < 0.1


def test_a_path_that_passes_in_the_best_sample_alone_does_not_fail_for_sure():
    found = chance_near_torque(plane(0.2, 0.0), rover_with(max_torque=0.1), use=1.19)
    assert found == 1.0 - 1.0 / SAMPLES


def test_what_fails_for_sure_further_on_changes_no_chance_before_it():
    ground, rover = plane(0.3, 0.0), rover_with(friction=0.1)
    x = ground.origin[0] + ground.resolution * np.arange(ground.elevation.shape[1])
    friction = np.broadcast_to(np.where(x > 0.45, 0.05, FRICTION), ground.elevation.shape)
    layered = replace(ground, friction=friction)
    found = chance_on(layered, rover, n=41)
    assert found.failure_chance == 1.0
    assert found.failure_chance_at[0] == chance_on(ground, rover, n=1).failure_chance > 0.1


def test_a_control_margin_is_not_asked_of_samples():
    rover, ground = rover_with(friction=0.1), plane(0.42, 0.0)
    optimal = replace(SLIPPERY, policy="optimal")
    told, kept = (
        chance_on(ground, rover, options)
        for options in (optimal, replace(optimal, control_margin=0.1))
    )
    assert kept.traversable and 0.0 < kept.failure_chance == told.failure_chance < 0.5


def test_optimal_torques_give_way_to_a_wheel_that_has_less():
    told = SweepOptions("optimal", friction=0.97, max_torque=1.0)
    ground, rover = drive_ground("step", 0.246), rover_with(max_torque_per_wheel=0.03)
    found = judge_path(rover, ground, drive_path(0.05), told, accepted_chance=1.0)[1]
    assert found.max_torque_saturation > 0.99 and found.failure_chance == 0.0


@pytest.mark.parametrize(
    ("ground", "name", "share"),
    [
        (plane(0.2, 0.0), "max_torque", 1.0),
        (plane(0.2, 0.0), "model", EVEN_SHARE),
        (make_terrain(lambda x, y: 0.12 * x**2 + 0.25 * x, half=3.0), "model", 1.0),
    ],
)
def test_the_torque_limit_counts_and_of_the_error_of_the_model_a_share_on_even_ground(
    ground, name, share
):
    found = chance_near_torque(ground, rover_with(**{name: 0.1}), use=0.97)
    assert found == pytest.approx(NormalDist(1.0, 0.1 * share).cdf(0.97), abs=ONE)


def test_a_peak_between_waypoints_counts_though_the_position_is_uncertain():
    step = make_terrain(lambda x, y: 0.06 * (x > 0.29), 0.02, 1.5)
    poses = poses_at(np.arange(-0.3, 0.5, 0.037))
    rover = rover_with(friction=0.1, position=0.02)
    options = SweepOptions(friction=0.6)
    prediction, found = judge_path(rover, step, poses, options, accepted_chance=1.0)
    assert prediction.friction_utilisation.max() < 0.6 < 0.9 < found.max_friction_utilisation
    expected = NormalDist(1.0, 0.1).cdf(found.max_friction_utilisation)
    assert found.failure_chance == pytest.approx(expected, abs=ONE)


@pytest.mark.parametrize("name", ["com", "friction_per_wheel"])
def test_deviations_count_near_the_limit_of_friction(name):
    assert 0.0 < chance_on(plane(0.27, 0.05), rover_with(**{name: 0.1})).failure_chance < 1.0


@pytest.mark.parametrize(
    ("name", "std"),
    [("mass", 1.0), ("heading", 0.3), ("wheel_radius", 0.1), ("max_torque_per_wheel", 0.1)],
)
def test_deviations_count_near_the_limit_of_torque(name, std):
    assert 0.0 < chance_near_torque(plane(0.1, 0.2), rover_with(**{name: std})) < 1.0


def test_rocks_beside_the_path_count(monkeypatch):
    """The path was told 0.03: where it is, the wheels touch the rocks' lower parts."""
    asked = load_rover("lsr1"), rocky(8), straight(21), SweepOptions(friction=0.6)
    told = judge_path(*asked, accepted_chance=1.0)[1].failure_chance
    monkeypatch.setattr(failure_chance, "FAR", 0.0)
    monkeypatch.setattr(failure_chance, "NEAR", 0.0)  # all poses are asked in all samples
    assert told == judge_path(*asked, accepted_chance=1.0)[1].failure_chance > 0.2


def test_walls_beside_the_path_count():
    """Between them the wheels, which end at 0.35 m, use next to nothing of any limit."""
    walls = make_terrain(lambda x, y: 0.5 * (abs(y) > 0.37), 0.02, 1.5)
    rover = replace(load_rover("lsr1"), uncertainty=replace(EXACT, position=0.03))
    for ground in (walls, with_std(walls, 1e-6)):
        asked = rover, ground, straight(5), SLIPPERY
        prediction, found = judge_path(*asked, sigmas=0, accepted_chance=1.0)
        assert found.traversable and prediction.friction_utilisation.max() < 0.1
        assert found.failure_chance > 0.1


def test_uncertain_heights_count():
    ground, rover = plane(0.25, 0.0), rover_with()
    assert chance_on(ground, rover).failure_chance == 0.0
    asked = rover, with_std(ground, 0.003), straight(5), SLIPPERY
    assert judge_path(*asked, sigmas=0, accepted_chance=1.0)[1].failure_chance > 0.0


def test_an_accepted_chance_decides():
    rover, ground = rover_with(friction=0.1), plane(0.3, 0.0)

    def judge(accepted: float | None, **others: bool):
        asked = rover, ground, straight(5), SLIPPERY
        return judge_path(*asked, accepted_chance=accepted, **others)[1]

    assert judge(0.3).traversable and not judge(0.3).code
    refused = judge(0.05)
    assert (refused.traversable, refused.code) == (False, CHANCE)
    assert "accepted 0.05" in refused.reason and "friction" in refused.reason
    early = judge(0.05, stop_at_failure=True)
    assert f"chance of at least {early.failure_chance:.2f}" in early.reason
    assert 0.05 < early.failure_chance < refused.failure_chance
    for wrong in (-1.0, 2.0, np.nan):
        with pytest.raises(ModelError, match="accepted_chance is .*0 to 1"):
            judge(wrong)
    plain = judge(None)
    assert plain.traversable and np.isnan(plain.failure_chance) and plain.failure_chance_at == ()
    lost = refuse_chance(plain, FailureChance(0.5, np.full(5, 0.5), ""), 0.05)
    assert lost.reason.endswith("most often here, 0.50, where it does not settle")


def test_a_path_that_is_refused_as_told_is_asked_for_its_chance_if_wanted():
    asked = rover_with(friction=0.1), plane(0.6, 0.0), straight(5), SLIPPERY
    told = judge_path(*asked, accepted_chance=0.05)[1]
    quick = judge_path(*asked, accepted_chance=0.05, chance_of_refused=False)[1]
    assert told.failure_chance > 0.9 and np.isnan(quick.failure_chance)
    assert (told.code, told.reason) == (quick.code, quick.reason) and told.code == "friction"


def test_a_rover_that_does_not_settle_fails_for_sure():
    beyond = np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    verdict = judge_poses(rover_with(), plane(0.0, 0.0), beyond, accepted_chance=1.0)[1]
    assert (verdict.failure_chance, verdict.failure_chance_at) == (1.0, (0.0, 1.0))


def test_unknown_ground_beside_the_path_is_no_failure():
    ground, rover = plane(0.3, 0.0), rover_with(friction=0.1, position=0.05)
    y = ground.origin[1] + ground.resolution * np.arange(len(ground.elevation))
    beyond = abs(y) > 0.36 + ground.resolution  # the wheels end at 0.35 m
    seen = replace(ground, elevation=np.where(beyond[:, None], np.nan, ground.elevation))
    told = chance_on(ground, rover).failure_chance
    assert 0.1 < told < 0.9
    assert chance_on(seen, rover).failure_chance == told


def test_the_docs_tell_what_is_uncertain_and_its_default():
    rows = re.findall(r"^- `(\w+)` \(([\d.]+)\)", DOCS.read_text(), re.MULTILINE)
    assert {name: float(value) for name, value in rows} == vars(Uncertainty())
    assert set(DEVIATES) == set(vars(Uncertainty()))


@pytest.mark.long
def test_chances_score_better_than_verdicts_on_drives_and_what_they_accept_passes():
    paths = [one for one in read_driven_paths() if one.stream == HELD_OUT]
    told = np.array([find_chance(one) for one in paths], float)
    failed = np.array([one.passed.count("0") / len(one.passed) for one in paths])
    chance, refused = ((1.0 - failed) * side**2 + failed * (1.0 - side) ** 2 for side in told.T)
    assert chance.mean() < refused.mean()
    assert failed[told[:, 0] < 0.05].mean() <= 0.01
