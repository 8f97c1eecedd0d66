# SPDX-License-Identifier: Apache-2.0
"""Shared torques on straight and turned wheels: they balance and need the least friction."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import judge_path, judge_poses
from rover_physics.errors import ModelError
from rover_physics.traction.balance import LOADS, TRACTIONS, BalanceWriter, MeasuredState
from rover_physics.traction.map_contacts import MapContactFinder
from rover_physics.traction.program import ProgramInputs
from rover_physics.traction.solver import TractionWorkspace, solve_traction
from support.best_torques import can_stand
from support.grounds import fractal, plane, random_poses
from support.rover_geometry import balance_matrix, place_rover
from support.rovers import LSR1, M2020
from support.traction_states import state_of

FRICTION = np.full(6, 0.8)


def level(angles=(0.0,) * 6):
    return MeasuredState(0.0, 0.0, 0.0, np.zeros(2), np.array(angles))


def solve(rover, state, friction=FRICTION, torque=None, programs=12, workspace=None):
    rows = BalanceWriter(rover).write(state, 0.0)
    inputs = ProgramInputs(friction, torque or rover.wheel.max_torque, rover.wheel.radius)
    return solve_traction(workspace or TractionWorkspace(), rows, inputs, max_programs=programs)


def test_a_resistance_is_overcome_by_each_wheel_as_fast_as_it_rolls_and_moves_no_load():
    angles = np.array([0.0, 0.0, 1.2, 0.0, 0.0, 0.0])
    writer = BalanceWriter(LSR1)
    still = writer.write(level(angles), 0.0)
    pushed = writer.write(level(angles), 0.0, resistance=12.0)
    unit, speeds = still.force_unit, still.wheel_speeds
    extra = 12.0 / unit * speeds / 6.0
    held = still.complete(np.linspace(0.0, 0.5, 6))
    found = pushed.complete(held[TRACTIONS] + extra)
    np.testing.assert_allclose(found[TRACTIONS], held[TRACTIONS] + extra, atol=1e-9)
    np.testing.assert_allclose(found[LOADS], held[LOADS], atol=1e-9)
    assert speeds[2] > 2.0 and abs(speeds[5]) < 1.0


@pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)
@pytest.mark.parametrize("push", [0.1, -0.2])
def test_the_wanted_push_acts_at_the_centre_of_mass(rover, push):
    # Body frame on level ground: what the wheels give has no moment about the centre of mass.
    rows = BalanceWriter(rover).write(level(), push * rover.weight)
    x = rows.force_unit * rows.complete(np.linspace(-0.1, 0.1, 6))
    lateral = rows.lateral_forces(x)
    forces = np.column_stack([x[TRACTIONS], lateral, x[LOADS]])
    standing = judge_path(rover, plane(0.0, 0.0, half=4.0), [[0.0, 0.0, 0.0]])[0]
    placed = place_rover(rover, standing, 0)
    masses, centres, *_ = zip(*placed.masses, strict=True)
    com = np.average(centres, axis=0, weights=masses)
    places = placed.wheels - [0.0, 0.0, rover.wheel.radius]
    assert np.sum(forces, axis=0) == pytest.approx(rover.weight * np.array([push, 0.0, 1.0]))
    moments = np.cross(places - com, forces).sum(axis=0)
    assert moments == pytest.approx(np.zeros(3), abs=1e-9 * rover.weight)


def test_up_a_plane_all_wheels_use_the_same_share_and_what_friction_and_motors_lack_is_told():
    prediction = judge_path(LSR1, plane(0.4, 0.0), [[0.0, 0.0, 0.0]])[0]
    answer = solve(LSR1, state_of(LSR1, prediction, 0))
    assert answer.utilisation == pytest.approx(np.full(6, 0.4 / 0.8), rel=2e-3)
    answer = solve(LSR1, state_of(LSR1, prediction, 0), friction=np.full(6, 0.2))
    assert not answer.fallback
    assert answer.friction_slack == pytest.approx(1.0, rel=0.02)
    needed = LSR1.weight * np.sin(np.arctan(0.4)) / 6.0 * LSR1.wheel.radius
    answer = solve(LSR1, state_of(LSR1, prediction, 0), torque=0.6 * needed)
    assert not answer.fallback
    assert answer.torque_slack == pytest.approx(0.4 * needed, rel=0.02)
    assert np.abs(answer.torques).max() == pytest.approx(0.6 * needed)


def test_across_a_slope_no_wheel_slips_before_all_do_where_sideways_forces_go_by_the_loads():
    slope = 0.53
    prediction = judge_path(LSR1, plane(0.0, slope), [[0.0, 0.0, 0.0]])[0]
    state, friction = state_of(LSR1, prediction, 0), np.full(6, 0.6)
    equal = solve(LSR1, state, friction)
    assert equal.friction_slack > 0.1, "the upper wheels, of which equal parts ask too much"
    by_load = solve(LSR1, replace(state, loads=equal.loads), friction)
    assert by_load.utilisation.max() < 1.02 * slope / 0.6


def test_a_wheel_that_has_to_lift_is_told_with_its_missing_load():
    state = replace(level(), roll=1.2)
    answer = solve(LSR1, state)
    assert not answer.fallback
    assert answer.load_slack == pytest.approx(-answer.loads.min()) and answer.load_slack > 1.0
    assert np.isinf(answer.utilisation.max()) and np.isinf(answer.friction_slack)


def test_an_unsolved_program_falls_back_to_equal_torques_and_those_on_demand_are_no_fallback():
    _, prediction = curved_poses(LSR1, 0, 0.0)
    i = np.flatnonzero(prediction.settled)[0]
    state = state_of(LSR1, prediction, i)
    answer = solve(LSR1, state, workspace=TractionWorkspace(max_iterations=1))
    assert answer.fallback and answer.programs == 0 and answer.status != "solved"
    assert answer.torques == pytest.approx(prediction.torque[i], abs=1e-9)
    wanted = solve(LSR1, state, programs=0)
    assert not wanted.fallback and np.ptp(wanted.torques) < 1e-12


def test_contact_angles_without_equilibrium_and_ground_without_friction_are_refused():
    with pytest.raises(ModelError, match="must all be above 0"):
        solve(LSR1, level(), friction=np.zeros(6))
    with pytest.raises(ModelError, match="contact angles"):
        BalanceWriter(LSR1).write(level(np.full(6, np.pi / 2) * [1, 1, 1, -1, -1, -1]), 0.0)


CURVATURES = (0.0, 0.5, -0.5, 1.2, -2.5, np.inf, -np.inf)
BOTH = pytest.mark.parametrize("rover", [LSR1, M2020], ids=lambda rover: rover.name)


def curved_poses(rover, seed, curvature):
    """Return settled random poses on rough ground with wheels turned for a curvature."""
    poses = random_poses(seed, 12, 1.5)
    curvatures = np.full(len(poses), curvature / (2.0 if rover is M2020 else 1.0))
    ground = plane(0.15, 0.1, half=5.0) if rover is M2020 else fractal(seed)
    return ground, judge_poses(rover, ground, poses, curvatures)[0]


def test_the_answer_is_within_3_percent_of_the_optimum_and_better_than_equal_torques_in_curves():
    better = []
    for seed, curvature in enumerate(CURVATURES):
        _, prediction = curved_poses(LSR1, seed, curvature)
        for i in np.flatnonzero(prediction.settled):
            state = state_of(LSR1, prediction, i)
            used, by_equal = (solve(LSR1, state, programs=count) for count in (12, 0))
            assert not used.fallback and used.load_slack == used.torque_slack == 0.0
            A, b, _ = balance_matrix(LSR1, prediction, i, shared=False)
            forces = np.concatenate([used.loads, used.tractions, used.lateral])
            assert np.abs(A @ forces / LSR1.weight - b).max() < 1e-6
            most = used.utilisation.max()
            better.append(most / by_equal.utilisation.max())
            assert curvature or not can_stand(LSR1, prediction, i, most / 1.03, 2.0)
    assert max(better) < 1.001 and np.median(better) < 0.95


@BOTH
def test_equal_torques_are_those_of_the_sweep(rover):
    writer, count = BalanceWriter(rover), 0
    for seed, curvature in enumerate(CURVATURES):
        _, prediction = curved_poses(rover, seed, curvature)
        for i in np.flatnonzero(prediction.settled):
            rows = writer.write(state_of(rover, prediction, i), 0.0)
            x = rows.force_unit * rows.pull_equally()
            found = x[LOADS], x[TRACTIONS], rows.lateral_forces(x)
            for values, name in zip(found, ("wheel_loads", "tangential", "lateral"), strict=True):
                right = getattr(prediction, name)[i]
                assert values == pytest.approx(right, abs=1e-8 * rover.weight), (curvature, name)
            count += 1
    assert count > 40


@BOTH
def test_a_push_does_its_work_along_the_way_of_the_wheels(rover):
    writer = BalanceWriter(rover)
    for curvature in (0.0, 0.4, -0.4, np.inf):
        ground = plane(0.0, 0.0, half=5.0)
        prediction = judge_poses(rover, ground, np.zeros((1, 3)), [curvature])[0]
        state = state_of(rover, prediction, 0)
        still, pushed = (writer.write(state, push) for push in (0.0, 6.0))
        more = pushed.force_unit * (pushed.pull_equally() - still.pull_equally())[TRACTIONS]
        assert more @ still.wheel_speeds == pytest.approx(6.0, rel=1e-9)
        assert (more * still.directions > 0.0).all()
        rolling = writer.find_rolling(state)
        assert rolling.directions == pytest.approx(still.directions)
        assert rolling.speeds == pytest.approx(still.wheel_speeds, abs=0.05)


@pytest.mark.parametrize("drift", [0.0, 0.05])
def test_the_map_tells_the_contact_angles_whatever_height_odometry_says(drift):
    errors = []
    for seed, curvature in enumerate(CURVATURES):
        ground, prediction = curved_poses(LSR1, seed, curvature)
        finder = MapContactFinder(LSR1, ground)
        for i in np.flatnonzero(prediction.settled):
            pose = np.array([*prediction.position[i], prediction.poses[i, 2]])
            pose[2] += drift
            directions = np.where(prediction.wheel_speed[i] < 0.0, -1.0, 1.0)
            found = finder.find(state_of(LSR1, prediction, i), pose, 0.0, directions)
            assert found.source == "map"
            errors.append(found.angles - prediction.contact_angle[i])
    assert np.median(np.abs(errors)) < 0.03
