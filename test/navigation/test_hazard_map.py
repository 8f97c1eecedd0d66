"""A hazard map has the class of each pose, and what a change cannot reach is not judged again."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.numerics.interruption import interruptible
from rover_physics.prediction.map_sweep import sweep_map
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES, classify_judged
from rover_physics.traversability.judge import judge_poses
from rover_planner.planning.navigation import hazard_map, pose_classes
from rover_planner.planning.navigation.class_kernels import IMPASSABLE, UNKNOWN
from rover_planner.planning.navigation.hazard_map import HazardMap
from rover_planner.planning.navigation.pose_classes import (
    RoverOnMap,
    classify_poses,
    judge_classes,
)

LSR1 = load_rover("lsr1")
OPTIONS = SweepOptions(control_margin=0.3)


def rough(seed, shape=(50, 60), cell=0.1, noise=1.0) -> Terrain:
    """Return slopes with boulders and a hole of unknown ground."""
    rng = np.random.default_rng(seed)
    rows, columns = np.indices(shape)
    elevation = 0.35 * cell * columns + 0.06 * noise * rng.standard_normal(shape)
    elevation[:, : shape[1] // 2] = 0.05 * noise * rng.standard_normal((shape[0], shape[1] // 2))
    elevation[10:16, 10:16] = np.nan
    elevation[30:33, 12:15] += 0.6
    return Terrain(elevation, cell, (-2.0, 1.0))


def judged(terrain, headings=4, options=OPTIONS) -> HazardMap:
    hazards = HazardMap(headings)
    hazards.take(RoverOnMap(LSR1, terrain, options))
    assert hazards.work(600.0)
    return hazards


def poses_of(terrain, count=120):
    x0, x1, y0, y1 = terrain.bounds
    rng = np.random.default_rng(5)
    return np.column_stack(
        [rng.uniform(x0, x1, count), rng.uniform(y0, y1, count), rng.uniform(-3, 3, count)]
    )


@pytest.mark.parametrize("std", [None, 0.004])
def test_a_pose_has_the_class_that_a_path_there_would_have(std):
    terrain = rough(1)
    if std is not None:
        terrain = replace(terrain, elevation_std=np.full(terrain.elevation.shape, std))
    poses, ahead = poses_of(terrain), np.zeros(120)
    one = judge_poses(LSR1, terrain, poses, ahead, OPTIONS)
    told = classify_judged(LSR1, terrain, *one, OPTIONS, curvature=ahead)
    found = classify_poses(RoverOnMap(LSR1, terrain, OPTIONS), poses)
    for pose, number in zip(told, found, strict=True):
        if pose.constraint in ("off_map", "unknown_ground"):
            assert number == UNKNOWN
        else:
            assert TRAVERSABILITY_CLASSES[number] == pose.traversability_class
    assert len(set(found.tolist())) >= (4 if std is None else 3)


@pytest.mark.parametrize("rover", ["lsr1", "m2020"])
@pytest.mark.parametrize("kind", ["rough", "rocks", "slope", "soil", "layers"])
def test_the_quick_classes_are_those_of_the_full_judgement(kind, rover):
    cell = 0.1 if rover == "m2020" else 0.05
    terrain = rough(7, (90, 100), cell, {"rough": 1.0, "slope": 0.02}.get(kind, 0.3))
    options = OPTIONS
    if kind == "soil":
        options = replace(OPTIONS, soil="mars_simulant")
    if kind == "layers":
        friction = np.random.default_rng(1).uniform(0.1, 1.0, terrain.elevation.shape)
        terrain = replace(terrain, friction=friction)
    on_map = RoverOnMap(load_rover(rover), terrain, options)
    poses = poses_of(terrain, 250 if kind == "soil" else 800)
    quick, full = classify_poses(on_map, poses), judge_classes(on_map, poses)
    np.testing.assert_array_equal(quick, full)
    assert len(set(full.tolist())) >= 3


def test_threads_change_no_class():
    on_map, poses = RoverOnMap(LSR1, rough(1), OPTIONS), poses_of(rough(1), 5000)
    few = [classify_poses(on_map, poses[k : k + 500]) for k in range(0, 5000, 500)]
    np.testing.assert_array_equal(classify_poses(on_map, poses), np.concatenate(few))


def test_questions_can_go_first_every_256_poses():
    on_map, looked = RoverOnMap(LSR1, rough(1), OPTIONS), []
    poses = poses_of(rough(1), 5000)
    with interruptible(lambda: looked.append(None)):
        classify_poses(on_map, poses)
    assert len(looked) >= 5000 // 256

    def stop():
        raise InterruptedError

    with pytest.raises(InterruptedError), interruptible(stop):
        classify_poses(on_map, poses)


@pytest.mark.parametrize("excess", [-2e-9, -2e-10, 0.0, 2e-10, 2e-9])
def test_at_a_limit_the_full_judgement_decides(excess, monkeypatch):
    ramp = Terrain(0.3 * 0.05 * np.indices((60, 60))[1].astype(float), 0.05, (0.0, 0.0))
    pose = np.array([[1.5, 1.5, 0.0]])
    tilt = judge_poses(LSR1, ramp, pose, np.zeros(1))[0].pitch[0]
    limits = replace(LSR1.limits, tilt=abs(float(tilt)) + np.radians(excess))
    on_map = RoverOnMap(replace(LSR1, limits=limits), ramp, OPTIONS)
    asked = []
    monkeypatch.setattr(
        pose_classes,
        "judge_classes",
        lambda on_map, poses: asked.append(len(poses)) or judge_classes(on_map, poses),
    )
    assert classify_poses(on_map, pose) == judge_classes(on_map, pose)
    assert asked == ([1] if excess < 0.0 else [])  # within the limit there is no doubt
    assert (classify_poses(on_map, pose)[0] == IMPASSABLE) == (excess < -1e-9)


def test_no_cell_is_free_where_all_headings_fail():
    view = judged(rough(2)).view()
    fails = (view.classes == IMPASSABLE).all(axis=0)
    assert fails.sum() > 20
    assert (view.best()[fails] == IMPASSABLE).all() and (view.worst()[fails] == IMPASSABLE).all()
    some = (view.classes == IMPASSABLE).any(axis=0) & ~fails
    assert some.any() and (view.worst()[some] == IMPASSABLE).all()
    none_known = (view.classes == UNKNOWN).all(axis=0)
    assert (view.best()[none_known] == UNKNOWN).all()
    lost = (view.classes == UNKNOWN).any(axis=0) & ~(
        (view.classes >= 0) & (view.classes < IMPASSABLE)
    ).any(axis=0)
    assert (view.best()[lost] == UNKNOWN).all()


@pytest.mark.parametrize("seed", range(3))
def test_an_updated_map_equals_a_new_one_and_judges_little(seed, monkeypatch):
    before = rough(seed, (90, 90), 0.05, 0.2)
    elevation = before.elevation.copy()
    elevation[40:48, 50:57] += np.random.default_rng(seed).normal(0.0, 0.1, (8, 7))
    after = replace(before, elevation=elevation)
    hazards = judged(before)
    hazards.take(RoverOnMap(LSR1, after, OPTIONS))
    assert 0 < hazards.stale_count < 0.6 * 4 * 90 * 90
    counted = []
    monkeypatch.setattr(
        hazard_map,
        "classify_poses",
        lambda on_map, poses: counted.append(len(poses)) or classify_poses(on_map, poses),
    )
    stale = hazards.stale_count
    assert hazards.work(600.0) and sum(counted) == stale
    np.testing.assert_array_equal(hazards.view().classes, judged(after).view().classes)


@pytest.mark.parametrize("rover,cell", [("lsr1", 0.05), ("lsr1", 0.12), ("m2020", 0.1)])
@pytest.mark.parametrize("height", [-0.4, 0.5, np.nan])
def test_beyond_the_reach_of_a_changed_cell_no_score_changes(rover, cell, height):
    before = rough(8, (64, 64), cell, 0.3)
    elevation = before.elevation.copy()
    elevation[32, 31] = height
    after = replace(before, elevation=elevation)
    hazards = HazardMap(8)
    hazards.take(RoverOnMap(load_rover(rover), before, OPTIONS))
    hazards._stale[:] = False  # as if they were judged
    hazards.take(RoverOnMap(load_rover(rover), after, OPTIONS))
    _, old = next(sweep_map(load_rover(rover), before, 8, OPTIONS))
    _, new = next(sweep_map(load_rover(rover), after, 8, OPTIONS))
    fresh = ~np.moveaxis(hazards._stale, 0, -1)[: len(old.status)]
    np.testing.assert_array_equal(old.status[fresh], new.status[fresh])
    for name in ("friction_utilisation", "tip_over_ratio", "tilt", "belly_clearance"):
        one, other = getattr(old, name), getattr(new, name)
        np.testing.assert_allclose(one[fresh], other[fresh], rtol=1e-6, err_msg=name)
    changed = np.count_nonzero((old.status != new.status) | (abs(old.tilt - new.tilt) > 0.0))
    assert changed > 0.02 * hazards.stale_count  # the change counts


@pytest.mark.parametrize("rows,columns", [(7, -5), (0, 12), (-60, 0)])
def test_a_window_that_rolls_keeps_what_stays_and_equals_a_new_map(rows, columns):
    ground = rough(4, (140, 140), 0.05, 0.2)

    def window(row, column):
        x, y = ground.origin
        part = ground.elevation[row : row + 70, column : column + 80]
        return Terrain(part, 0.05, (x + 0.05 * column, y + 0.05 * row))

    hazards = judged(window(60, 30))
    after = window(60 + rows, 30 + columns)
    hazards.take(RoverOnMap(LSR1, after, OPTIONS))
    if rows != -60:
        assert hazards.stale_count < 4 * 70 * 80
    assert hazards.work(600.0)
    np.testing.assert_array_equal(hazards.view().classes, judged(after).view().classes)


def test_the_same_map_again_and_another_arrival_judge_nothing():
    terrain = rough(1)
    hazards = judged(terrain)
    hazards.take(RoverOnMap(LSR1, Terrain(**_parts(terrain)), OPTIONS))
    assert hazards.stale_count == 0


def _parts(terrain):
    return {
        "elevation": terrain.elevation.copy(),
        "resolution": terrain.resolution,
        "origin": terrain.origin,
    }


def test_another_rover_option_or_grid_judges_all_anew():
    terrain = rough(1)
    whole = 4 * terrain.elevation.size
    for other in (
        RoverOnMap(load_rover("m2020"), terrain, OPTIONS),
        RoverOnMap(LSR1, terrain, replace(OPTIONS, friction=0.5)),
        RoverOnMap(LSR1, replace(terrain, origin=(-2.03, 1.0)), OPTIONS),
        RoverOnMap(LSR1, replace(terrain, friction=np.full((50, 60), 0.7)), OPTIONS),
    ):
        hazards = judged(terrain)
        hazards.take(other)
        assert hazards.stale_count == whole


def test_what_is_not_judged_yet_is_unknown_and_the_nearest_tiles_come_first():
    terrain = rough(3, (100, 100), 0.05)
    hazards = HazardMap(2)
    assert hazards.view() is None
    hazards.take(RoverOnMap(LSR1, replace(terrain, elevation=np.zeros((100, 100))), OPTIONS))
    assert (hazards.view().classes == UNKNOWN).all()
    assert not hazards.work(0.0, near=(-2.0 + 4.0, 1.0 + 4.0))
    judged_cells = hazards.view().classes[0] != UNKNOWN
    assert judged_cells[70:90, 70:90].any() and not judged_cells[:60, :60].any()
