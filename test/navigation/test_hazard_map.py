# SPDX-License-Identifier: Apache-2.0
"""A hazard map has the class of each pose, and what a change cannot reach is not judged again."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, Terrain, judge_poses, load_rover
from rover_physics.numerics.interruption import interruptible
from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES, classify_judged
from rover_physics.traversability.pose_classes import RoverOnMap, classify_poses
from rover_planner.planning.navigation import hazard_map
from rover_planner.planning.navigation.hazard_map import HazardMap
from support.grounds import raised
from support.rovers import LSR1, M2020

OPTIONS = SweepOptions(control_margin=0.3)
UNKNOWN, IMPASSABLE = -1, TRAVERSABILITY_CLASSES.index("impassable")
"""Classes of cells whose ground was not seen, and where no policy passes."""


def rough(seed, shape=(50, 60), cell=0.1, noise=1.0) -> Terrain:
    """Return slopes with boulders and a hole of unknown ground."""
    rng = np.random.default_rng(seed)
    rows, columns = np.indices(shape)
    elevation = 0.35 * cell * columns + 0.06 * noise * rng.standard_normal(shape)
    elevation[:, : shape[1] // 2] = 0.05 * noise * rng.standard_normal((shape[0], shape[1] // 2))
    elevation[10:16, 10:16] = np.nan
    elevation[30:33, 12:15] += 0.6
    return Terrain(elevation, cell, (-2.0, 1.0))


def judged(terrain, headings=2, rover=LSR1) -> HazardMap:
    hazards = HazardMap(headings)
    hazards.take(RoverOnMap(rover, terrain, OPTIONS))
    assert hazards.work(600.0)
    return hazards


def poses_of(terrain, count=120):
    x0, x1, y0, y1 = terrain.bounds
    return np.random.default_rng(5).uniform((x0, y0, -3.0), (x1, y1, 3.0), (count, 3))


def classes_of_judgements(on_map: RoverOnMap, poses) -> np.ndarray:
    """Return the classes (n,) that single judgements of the poses tell."""
    rover, terrain, options = on_map.rover, on_map.terrain, on_map.options
    ahead = np.zeros(len(poses))
    one = judge_poses(rover, terrain, poses, ahead, options)
    told = classify_judged(rover, terrain, *one, options, curvature=ahead)
    unseen = ("off_map", "unknown_ground")
    return np.array([
        UNKNOWN if pose.constraint in unseen
        else TRAVERSABILITY_CLASSES.index(pose.traversability_class)
        for pose in told
    ])  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "name"),
    [("rough", "lsr1"), ("rough", "m2020"), ("soil", "lsr1"), ("layers", "m2020"),
     ("uncertain", "lsr1")],
)  # fmt: skip
def test_a_pose_has_the_class_that_a_path_there_would_have(kind, name):
    cell = 0.1 if name == "m2020" else 0.05
    terrain = rough(7, (90, 100), cell, 1.0 if kind == "rough" else 0.3)
    shape = terrain.elevation.shape
    options = replace(OPTIONS, soil="mars_simulant" if kind == "soil" else None)
    layers = {
        "layers": {"friction": np.random.default_rng(1).uniform(0.1, 1.0, shape)},
        "uncertain": {"elevation_std": np.full(shape, 0.004)},
    }
    on_map = RoverOnMap(load_rover(name), replace(terrain, **layers.get(kind, {})), options)
    poses = poses_of(terrain, 150 if kind in ("soil", "uncertain") else 300)
    found = classify_poses(on_map, poses)
    np.testing.assert_array_equal(found, classes_of_judgements(on_map, poses))
    assert len(set(found.tolist())) >= 3


def test_questions_can_go_first_every_256_poses():
    on_map, poses, looked = RoverOnMap(LSR1, rough(1), OPTIONS), poses_of(rough(1), 2000), []
    with interruptible(lambda: looked.append(None)):
        classify_poses(on_map, poses)
    assert len(looked) >= 2000 // 256


@pytest.mark.parametrize("excess", [-2e-9, -2e-10, 2e-9])
def test_at_a_limit_a_pose_has_the_class_of_the_full_judgement(excess):
    ramp = Terrain(0.3 * 0.05 * np.indices((60, 60))[1].astype(float), 0.05, (0.0, 0.0))
    pose = np.array([[1.5, 1.5, 0.0]])
    tilt = judge_poses(LSR1, ramp, pose, np.zeros(1))[0].pitch[0]
    limits = replace(LSR1.limits, tilt=abs(float(tilt)) + excess)
    on_map = RoverOnMap(replace(LSR1, limits=limits), ramp, OPTIONS)
    found = classify_poses(on_map, pose)
    assert found == classes_of_judgements(on_map, pose)
    assert (found[0] == IMPASSABLE) == (excess < -1e-9)


def test_no_cell_is_free_where_all_headings_fail():
    view = judged(rough(2)).view()
    fails = (view.classes == IMPASSABLE).all(axis=0)
    assert fails.sum() > 20
    assert (view.best()[fails] == IMPASSABLE).all() and (view.worst()[fails] == IMPASSABLE).all()
    some = (view.classes == IMPASSABLE).any(axis=0) & ~fails
    assert some.any() and (view.worst()[some] == IMPASSABLE).all()
    passes = ((view.classes >= 0) & (view.classes < IMPASSABLE)).any(axis=0)
    lost = (view.classes == UNKNOWN).any(axis=0) & ~passes
    assert lost.any() and (view.best()[lost] == UNKNOWN).all()


@pytest.mark.parametrize(
    ("rover", "cell", "cells", "by"),
    [
        (LSR1, 0.05, np.s_[40:48, 50:57], np.random.default_rng(1).normal(0.0, 0.1, (8, 7))),
        (LSR1, 0.12, (42, 41), -0.4),
        (M2020, 0.1, (42, 41), np.nan),
    ],
)
def test_an_updated_map_equals_a_new_one_and_judges_little(rover, cell, cells, by):
    before = rough(8, (60, 60), cell, 0.2)
    after = raised(before, cells, by)
    hazards = judged(before, 1, rover)
    old = hazards.view().classes.copy()
    hazards.take(RoverOnMap(rover, after, OPTIONS))
    assert 0 < hazards.stale_count < 0.6 * 60 * 60
    assert hazards.work(600.0) and hazards.stale_count == 0
    new = judged(after, 1, rover).view().classes
    np.testing.assert_array_equal(hazards.view().classes, new)
    assert (new != old).any()  # the change counts


@pytest.mark.parametrize(("rows", "columns"), [(7, -5), (-55, 0)])
def test_a_window_that_rolls_keeps_what_stays_and_equals_a_new_map(rows, columns):
    ground = rough(4, (110, 110), 0.05, 0.2)

    def window(row, column):
        x, y = ground.origin
        part = ground.elevation[row : row + 50, column : column + 60]
        return Terrain(part, 0.05, (x + 0.05 * column, y + 0.05 * row))

    hazards = judged(window(55, 30), 1)
    after = window(55 + rows, 30 + columns)
    hazards.take(RoverOnMap(LSR1, after, OPTIONS))
    if rows != -55:
        assert hazards.stale_count < 50 * 60
    assert hazards.work(600.0)
    np.testing.assert_array_equal(hazards.view().classes, judged(after, 1).view().classes)


def test_the_same_map_judges_nothing_and_another_rover_option_or_grid_all_anew():
    soil = {"soil": np.zeros((36, 40), np.int32), "soil_names": ("mars_simulant",)}
    terrain = replace(rough(1, (36, 40)), **soil)
    hazards = judged(terrain, 1)
    hazards.take(RoverOnMap(LSR1, replace(terrain, elevation=terrain.elevation.copy()), OPTIONS))
    assert hazards.stale_count == 0
    for other in (
        RoverOnMap(M2020, terrain, OPTIONS),
        RoverOnMap(LSR1, terrain, replace(OPTIONS, friction=0.5)),
        RoverOnMap(LSR1, replace(terrain, origin=(-2.03, 1.0)), OPTIONS),
        RoverOnMap(LSR1, replace(terrain, friction=np.full((36, 40), 0.7)), OPTIONS),
        RoverOnMap(LSR1, replace(terrain, soil_names=("dry_sand",)), OPTIONS),
    ):
        hazards.take(RoverOnMap(LSR1, terrain, OPTIONS))
        hazards.work(600.0)
        hazards.take(other)
        assert hazards.stale_count == terrain.elevation.size


def test_what_is_not_judged_yet_is_unknown_and_the_nearest_tiles_come_first():
    terrain = rough(3, (100, 100), 0.05)
    hazards = HazardMap(2)
    assert hazards.view() is None
    hazards.take(RoverOnMap(LSR1, replace(terrain, elevation=np.zeros((100, 100))), OPTIONS))
    assert (hazards.view().classes == UNKNOWN).all()
    assert not hazards.work(0.0, near=(-2.0 + 4.0, 1.0 + 4.0))
    judged_cells = hazards.view().classes[0] != UNKNOWN
    assert judged_cells[70:90, 70:90].any() and not judged_cells[:60, :60].any()


def test_a_slice_of_work_on_a_large_map_lists_no_cells_but_those_that_it_judges(monkeypatch):
    monkeypatch.setattr(hazard_map, "classify_poses", lambda _, poses: np.zeros(len(poses), int))
    hazards = HazardMap(1)
    hazards.take(RoverOnMap(LSR1, Terrain(np.zeros((1000, 1000)), 0.1, (0.0, 0.0)), OPTIONS))
    tracemalloc.start()
    assert not hazards.work(0.0)
    assert tracemalloc.get_traced_memory()[1] < 1000 * 1000
    tracemalloc.stop()
