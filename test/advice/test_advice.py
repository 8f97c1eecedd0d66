# SPDX-License-Identifier: Apache-2.0
"""Advice: each remedy passes as told, less of it does not, and few levers come before more."""

import re
from dataclasses import replace
from functools import cache
from itertools import permutations, takewhile

import numpy as np
import pytest

from rover_physics import judge_path
from rover_physics.names import WHEELS
from rover_physics.numerics.interruption import interruptible
from rover_physics.rover.steering_joints import tightest_radius
from rover_physics.rover.uncertainty import ACCEPTED_CHANCE
from rover_planner.advice import seek
from rover_planner.advice.advise import STOPPED, Advice, grow_advice, path_of
from rover_planner.advice.case import SEARCH, Case, case_of
from rover_planner.advice.levers import LEVERS, Choice
from rover_planner.advice.path_changes import bend_path
from rover_planner.advice.seek import TOLERANCE
from rover_planner.planning.answering.budget import QuestionStoppedError
from rover_planner.planning.marked_places import MARKED_CODE, MarkedPlace, MarkedPlaces
from rover_planner.planning.path_geometry import distance_along
from rover_planner.planning.path_query import PathQueryOptions
from rover_planner.planning.search.query import Site
from support.grounds import enlarged, make_terrain, rock_left
from support.rovers import FIXED, LSR1, M2020, similar

S = np.arange(-1.5, 1.6, 0.05)
STRAIGHT = np.column_stack([S, 0.0 * S, 0.0 * S])


def slope(x, y):
    return 0.3 * x


def wall(x, y):
    """Return level ground with a wall that nothing leads around."""
    return 1.0 * (x > 0.5)


CASES = {
    "slippery slope": (slope, {"friction": 0.45}, {"policy", "friction"}),
    "heavy load": (slope, {"payload": 4.0}, {"payload", "arm_shoulder", "policy"}),
    "rock": (rock_left, {}, {"shift", "curve", "turn_on_the_spot", "ground"}),
}
"""Ground, options, and levers that are to be found."""


def refused_by(height, **options):
    return Case(Site(LSR1, make_terrain(height, half=2.6)), STRAIGHT).change(**options)


@cache
def advise_on(name: str) -> tuple[Advice, set[str]]:
    """Return advice on a case after all trials of single levers, and the levers to be found."""
    height, options, levers = CASES[name]
    single = takewhile(lambda one: len(one.tried) < 2, grow_advice(refused_by(height, **options)))
    *_, advice = single
    return advice, levers


@pytest.mark.parametrize("asked, accepted", [(0.0, 0.0), (0.2, 0.2), (1.0, ACCEPTED_CHANCE)])
def test_remedies_have_the_chance_that_is_accepted_or_else_the_usual_one(asked, accepted):
    options = PathQueryOptions(accepted_chance=asked)
    case = case_of(Site(LSR1, make_terrain(slope), options), STRAIGHT)
    assert case.site.options.accepted_chance == accepted


@pytest.fixture(params=CASES)
def advised(request) -> tuple[Advice, set[str]]:
    return advise_on(request.param)


def test_the_levers_that_help_are_found_and_the_rover_s_own_come_first(advised):
    advice, levers = advised
    assert {one.levers[0].lever.name for one in advice.found} >= levers
    outside = [one.needs_others for one in advice.found]
    assert outside == sorted(outside)


def test_each_remedy_passes_by_the_options_and_the_path_that_are_told(advised):
    for remedy in advised[0].remedies:
        case, told = remedy.refusal.case, remedy.to_dict()
        options = replace(case.options, **told["options"])
        poses = np.array(told.get("poses", case.poses))
        _, verdict = judge_path(LSR1, case.terrain, poses, options, accepted_chance=0.05)
        assert verdict.traversable, told["words"]
        assert told["chance"] == verdict.failure_chance <= 0.05
        assert 0.0 < told["largest_use"] <= 1.0


def test_a_little_less_of_a_remedy_is_refused(advised):
    for remedy in advised[0].found:
        (one,) = remedy.levers
        span = one.lever.settings(remedy.refusal)
        if isinstance(span, Choice):
            continue
        end = max(span.ends, key=lambda end: (end - span.now) * (one.value - span.now))
        less = one.value - 1.01 * TOLERANCE * (end - span.now)
        case = one.lever.apply(remedy.refusal.case, remedy.refusal, less)
        assert not case.judge().passes, remedy.describe()


def test_ground_is_lowered_on_the_part_of_a_large_map_around_the_path():
    case = Case(Site(LSR1, make_terrain(rock_left, half=20.0)), STRAIGHT)
    refusal, lever = case.judge(), next(one for one in LEVERS if one.name == "ground")
    lowered = lever.apply(case, refusal, lever.settings(refusal).ends[0])
    assert not refusal.passes and lowered.judge().passes
    assert lowered.terrain.elevation.size < 0.2 * case.terrain.elevation.size


def test_a_remedy_of_a_path_into_a_marked_place_keeps_out_of_it(monkeypatch):
    """The path was told to be traversable as it is."""
    place = MarkedPlace(0.3, 0.0, 0.2, "stuck", "today")
    monkeypatch.setattr(seek, "LEVERS", [one for one in LEVERS if one.name in ("policy", "shift")])
    level = make_terrain(lambda x, y: 0.0 * x, half=2.6)
    *_, advice = grow_advice(Case(Site(LSR1, level, marked=MarkedPlaces((place,))), STRAIGHT))
    assert advice.judged.verdict.code == MARKED_CODE
    (shift,) = advice.remedies
    x, y, _ = shift.judged.case.poses.T
    assert np.hypot(x - place.x, y - place.y).min() >= place.radius


def test_words_say_what_to_do_and_what_it_does_to_the_rover():
    advice, _ = advise_on("heavy load")
    (payload,) = (one for one in advice.found if one.levers[0].lever.name == "payload")
    old, new = (
        one.prediction.wheel_loads[advice.judged.place] for one in (advice.judged, payload.judged)
    )
    rear = [wheel.startswith("rear") for wheel in WHEELS]
    expected = (
        rf"Carry .* kg less at the arm's tip: the rear wheels then carry "
        rf"{(old - new)[rear].sum():.1f} N less; largest use 0\..* m \(friction\)"
    )
    assert re.fullmatch(expected, payload.describe())


def test_several_levers_are_set_where_none_helps_alone(monkeypatch):
    still = [one for one in seek.LEVERS if not one.changes_path]
    monkeypatch.setattr(seek, "LEVERS", still)
    steep = make_terrain(lambda x, y: 0.45 * x, half=2.6)
    case = Case(Site(LSR1, steep), STRAIGHT[24:36]).change(payload=6.0)
    for advice in grow_advice(case):
        own = [one for one in advice.found if not one.needs_others]
        if len(advice.tried) < 2:
            assert not own
        elif own:
            break
    assert len(own[0].levers) == 2 and " the arm by " in own[0].describe()
    for one, other in permutations(own[0].levers):
        alone = one.lever.apply(case, own[0].refusal, one.value)
        assert not alone.judge().passes, other.lever.name


def test_what_was_not_tried_in_time_is_told():
    told: list[Advice] = []

    def check() -> None:
        if len(told) == 3:
            raise QuestionStoppedError("too_long", "the time is over")

    with interruptible(check):
        for advice in grow_advice(refused_by(wall)):
            told.append(advice)
    assert len(told) == 3 and told[-1].tried and not told[-1].found and not told[-1].complete
    assert told[-1].describe() == "no lever that was tried in time helps"
    # Not even the path is judged.
    with interruptible(check), pytest.raises(QuestionStoppedError, match=f"^{STOPPED}$"):
        list(grow_advice(refused_by(wall)))


@pytest.mark.parametrize("rover", [LSR1, M2020, FIXED], ids=["lsr1", "m2020", "fixed"])
def test_two_poses_far_apart_are_ends_of_a_path_with_the_tightest_curve_of_the_rover(rover):
    ends = np.array([[0.0, 0.0, 0.0], [-rover.wheelbase, 0.0, 0.0]])
    path = path_of(rover, ends, 0.01)
    np.testing.assert_allclose(path[[0, -1]], ends)
    turned = np.abs(np.diff(np.unwrap(path[:, 2])))
    radius = np.diff(distance_along(path)).max() / turned.max()
    assert radius == pytest.approx(tightest_radius(rover), rel=0.02)
    assert len(path_of(rover, 0.4 * ends, 0.01)) == 2 and len(path_of(rover, ends[:1], 0.01)) == 1


def test_energy_and_time_are_above_those_of_the_path_as_if_it_went_on():
    """The path fails at its first waypoint, so that nothing lies before it."""
    advice, _ = advise_on("slippery slope")
    refused, found = advice.judged, advice.found[0]
    assert refused.place == 0
    # The climb is the same; what servos slip costs more.
    assert 0.0 < found.extra_energy < 0.3 * refused.energy
    assert 0.0 < found.extra_time < 0.3 * refused.time


def test_a_use_of_servos_tells_how_far_away_a_failure_is():
    """Servos use all friction on a slope, and may lift a wheel, without failing."""
    judged = refused_by(slope, policy="servo").judge()
    assert judged.passes
    use, _, limit = judged.largest_use
    assert limit == "tilt"
    assert use == pytest.approx(np.arctan(0.3) / LSR1.limits.tilt, rel=0.02)


def test_a_piece_fails_only_where_the_path_does():
    """Each waypoint before the first failure passes in its piece, and that one fails in it."""
    case = replace(refused_by(rock_left, policy="servo"), poses=bend_path(STRAIGHT, 0.1))
    refused = case.judge()
    for place in range(refused.place + 1):
        there = replace(refused, verdict=replace(refused.verdict, first_failure=place))
        assert there.fails_alike(case) == (place == refused.place), place


def test_a_gap_that_coarse_steps_miss_is_found(monkeypatch):
    """The path has to go 0.40 m aside within some cm; coarse steps are 16 cm."""
    curve = tuple(one for one in seek.LEVERS if one.name == "curve")
    monkeypatch.setattr(seek, "LEVERS", curve)

    def gate(x, y):
        return 1.0 * ((np.abs(x) < 0.2) & (np.abs(y - 0.4) > 0.44))

    case = refused_by(gate).change_site(terrain=make_terrain(gate, resolution=0.02, half=2.4))
    _, coarse, fine, _ = grow_advice(case)
    assert not coarse.found and coarse.tried == fine.tried == ("curve",)
    (setting,) = fine.found[0].levers
    assert setting.value == pytest.approx(0.4, abs=0.04)


def test_a_path_that_mostly_turns_on_the_spot_is_driven_backward():
    refusal = refused_by(slope, friction=0.3).judge()
    turn = np.tile(STRAIGHT[0], (100, 1)) + np.linspace([0.0, 0.0, -1.0], 0.0, 100)
    turning = replace(refusal.case, poses=np.concatenate([turn, STRAIGHT]))
    backward = next(lever for lever in LEVERS if lever.name == "backward")
    reversed_ = backward.apply(turning, refusal, True)
    assert reversed_ is not None and (reversed_.poses[0] == turn[0]).all()


@pytest.mark.parametrize("size", [0.25, 2.0])
def test_the_way_around_passes_and_is_as_long_for_the_size_of_the_rover(size, monkeypatch):
    unhurried = replace(SEARCH, budget=30.0)  # a busy machine is slow
    monkeypatch.setattr("rover_planner.advice.case.SEARCH", unhurried)

    def way_around(size: float) -> float:
        ground = enlarged(make_terrain(rock_left, half=3.0), size)
        poses = STRAIGHT * [size, size, 1.0]
        case = Case(Site(similar(LSR1, size), ground), poses)
        path = case.judge().path_around
        np.testing.assert_allclose(path[[0, -1]], poses[[0, -1]], atol=1e-9)
        assert replace(case, poses=path).judge().passes
        return distance_along(path)[-1]

    assert way_around(size) == pytest.approx(size * way_around(1.0), rel=1e-3)
