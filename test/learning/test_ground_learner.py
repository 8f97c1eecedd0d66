# SPDX-License-Identifier: Apache-2.0
"""A drive tells its ground: bounds while wheels grip, friction as they slip, and sticking."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.rover.rover_file import load_rover
from rover_physics.rover.steered_drive import SteeredDrive
from rover_planner.learning.drive_log import RATES, STEERING, SUSPENSION, TIME, TORQUES, YAW, X
from rover_planner.learning.ground_learner import GroundLearner
from support.grounds import plane
from support.learning_drives import climb, row_of_plant
from support.reference_drives import drive_ground

SPEED = 0.06
ROVER = replace(load_rover("lsr1"), nominal_speed=SPEED)
SLOPE = 0.3
RAMP, LEVEL = (plane(slope, 0.0, half=3.0) for slope in (SLOPE, 0.0))


def learn(rows, terrain=RAMP, rover=ROVER) -> GroundLearner:
    """Return a learner that has taken rows."""
    learner = GroundLearner(rover, terrain)
    for row in rows:
        learner.take(row)
    return learner


@pytest.mark.parametrize("spacing", [1, 10])
def test_wheels_that_grip_prove_a_friction_and_nothing_above_however_rarely_a_pose_is_measured(
    spacing,
):
    rows = climb(ROVER, SLOPE, 20.0)
    rows[np.arange(len(rows)) % spacing != 0, X : SUSPENSION.stop] = np.nan
    estimate = learn(rows).estimate
    assert 0.6 * SLOPE < estimate.friction.low < 1.1 * SLOPE
    assert estimate.friction.high is None
    assert estimate.slip_time is None and estimate.immobilised_time is None
    assert not estimate.faults
    assert abs(estimate.resistance) < 0.02
    assert np.abs(estimate.slip_ratios).max() < 0.05


def test_wheels_that_roll_because_they_are_steered_do_not_slip():
    rows = climb(ROVER, 0.0, 10.0, speed=0.0)
    offset, rate = 0.04, 0.35  # from a contact at the rim of the width
    rows[:, STEERING.start] = rate * (rows[:, TIME] % 4.0)
    rows[:, RATES.start] += offset * rate / ROVER.wheel.radius
    assert learn(rows, LEVEL).estimate.slip_time is None


def test_ground_is_marked_where_wheels_have_been():
    learner = learn(climb(ROVER, SLOPE, 20.0)[::5])
    known = np.isfinite(learner.layers[0])
    x, y = RAMP.origin
    rows, columns = np.nonzero(known)
    assert known.any() and np.abs(y + 0.04 * rows).min() > 0.2
    assert np.abs(x + 0.04 * columns).max() < 1.4
    assert (learner.layers[1][known] > 0.0).all()
    assert (learner.layers[0][known] <= ROVER.friction).all()  # all grip: it is told, no more


def test_wheels_that_slip_on_one_class_of_ground_tell_all_of_it_and_nothing_of_another():
    x = RAMP.origin[0] + RAMP.resolution * np.arange(RAMP.elevation.shape[1])
    y = RAMP.origin[1] + RAMP.resolution * np.arange(RAMP.elevation.shape[0])
    classes = np.where(x > 0.0, 7.0, 4.0) + 0.0 * y[:, None]
    classes[y > 1.0] = np.nan
    rows = climb(ROVER, SLOPE, 40.0, speed=0.04)[::5]
    rows[rows[:, X] > 0.4, RATES] *= 1.6
    learner = learn(rows, replace(RAMP, ground_class=classes))
    slick, other = learner.estimate.classes[7], learner.estimate.classes[4]
    assert slick.low < SLOPE < slick.high
    assert other.high is None and other.mean > 0.7
    (friction, std), felt = learner.layers, learner.ground.visited[0]
    been = np.isfinite(felt)
    far = (classes == 7.0) & ~been
    assert been.any() and (friction[far] == slick.mean).all()
    assert (std[far] == slick.std).all()
    assert np.isnan(friction[(classes == 4.0) & ~been]).all()
    assert np.isnan(friction[y > 1.0]).all()
    np.testing.assert_array_equal(friction[been], felt[been])


def test_torques_that_fluctuate_tell_slips_less_surely_and_prove_no_friction_by_chance():
    rows = climb(ROVER, SLOPE, 40.0, speed=0.02)[::5]
    noisy = rows.copy()
    noisy[:, TORQUES] *= 1.0 + 0.3 * np.random.default_rng(2).standard_normal((len(rows), 6))
    assert learn(noisy).estimate.friction.low < SLOPE
    rows[rows[:, X] > 0.3, RATES] *= 3.5
    steady = learn(rows).estimate.friction
    rows[::2, TORQUES] *= 1.5
    rows[1::2, TORQUES] *= 0.5
    shaky = learn(rows).estimate.friction
    assert steady.low < SLOPE < steady.high and shaky.low < SLOPE < shaky.high
    assert shaky.high - shaky.low > 1.1 * (steady.high - steady.low)


def test_torques_beyond_what_holds_the_rover_make_a_slip_tell_less_surely():
    rows = climb(ROVER, SLOPE, 40.0, speed=0.02)[::5]
    start = int(np.argmax(rows[:, X] > 0.3))
    rows = rows[: start + 20]
    rows[start:, RATES.start] *= 3.5
    held = learn(rows).estimate.friction
    grips = TORQUES.start + np.array([1, 2, 4, 5])
    rows[start:, grips] *= 1.5  # as where wheels push a face that the map lacks
    pushed = learn(rows).estimate.friction
    assert held.low < SLOPE < held.high and pushed.low < SLOPE < pushed.high
    assert pushed.high / pushed.low > 1.05 * held.high / held.low


def test_a_wheel_that_slips_at_one_place_tells_soon_all_that_it_can_tell():
    rows = climb(ROVER, SLOPE, 60.0, speed=0.0)[::5]
    rows[:, RATES] = [0.6, 0.0, 0.0, 0.0, 0.0, 0.0]
    soon, late = learn(rows[:50]).estimate.friction, learn(rows).estimate.friction
    assert soon.low < SLOPE < soon.high
    assert late.high / late.low == pytest.approx(soon.high / soon.low, rel=0.01)
    assert late.std == pytest.approx(soon.std, rel=0.01)


def test_wheels_that_disagree_about_the_friction_tell_it_less_surely():
    rows = climb(ROVER, SLOPE, 6.0, speed=0.0)[::5]
    rows[:, RATES] = 0.6
    alike = learn(rows).estimate.friction
    rows[:, TORQUES] *= [1.3, 0.61, 1.0, 1.3, 0.64, 1.0]  # the sum stays
    unlike = learn(rows).estimate.friction
    assert unlike.low < SLOPE < unlike.high
    assert unlike.high / unlike.low > 1.1 * alike.high / alike.low


def test_loads_that_no_ground_gives_tell_nothing():
    rows = climb(ROVER, SLOPE, 20.0, speed=0.02)[::5]
    rows[:, RATES] *= 3.5
    # Two rear wheels pull back and one bogie pushes: its front wheel would hang on the ground.
    rows[:, TORQUES] += [-2.0, 2.0, 2.0, -2.0, 0.0, 0.0]
    learner = learn(rows)
    assert learner.window.loads[2] < -0.1 * ROVER.weight
    assert learner.estimate.friction.high is None and learner.estimate.friction.low < 0.1


def test_torques_beyond_what_holds_the_rover_and_slip_that_noise_hides_prove_no_friction():
    rows = climb(ROVER, SLOPE, 20.0)[::5]
    pushed = rows.copy()
    pushed[rows[:, X] > 0.3, TORQUES] *= 2.0  # as where wheels push a face that the map lacks
    assert learn(pushed).estimate.friction.low < 1.2 * SLOPE
    rows[rows[:, X] > 0.0, RATES] *= 3.0
    # Two wheels spin with more torque, two with less: the sum still holds the rover.
    rows[rows[:, X] > 0.0, TORQUES] *= [1.8, 0.2, 1.0, 0.3, 1.8, 1.0]
    rows[:, X] += 0.01 * np.random.default_rng(1).standard_normal(len(rows))
    assert learn(rows).estimate.friction.low < 0.9 * SLOPE


@pytest.mark.parametrize("speed", [0.02, 0.06, 0.6])
def test_slip_over_a_short_way_is_seen_at_any_speed(speed):
    wheel, way = replace(ROVER.wheel, max_speed=2.0 * speed / ROVER.wheel.radius), 0.15
    rover = replace(ROVER, nominal_speed=speed, wheel=wheel)
    rows = climb(rover, SLOPE, 1.2 / speed, speed)
    rows[(rows[:, X] > 0.0) & (rows[:, X] < way), RATES] *= 1.6
    estimate = learn(rows, rover=rover).estimate
    assert estimate.slip_time == pytest.approx(0.6 / speed, abs=way / speed)


def test_a_gap_and_a_jump_of_the_odometry_are_no_slip():
    rows = climb(ROVER, SLOPE, 20.0)[::5]
    rows = np.delete(rows, slice(60, 80), axis=0)
    rows[100:, X] += 0.3
    assert learn(rows).estimate.slip_time is None


@pytest.mark.parametrize("wheels", [3, 6])
def test_wheels_whose_rates_are_missing_while_the_rover_stands_do_not_slip_and_are_not_stuck(
    wheels,
):
    rows = climb(ROVER, SLOPE, 20.0)[::5]
    rows[80:, X] -= rows[120, X] - rows[80, X]
    rows[80:120, X] = rows[80, X]
    rows[80:120, RATES] *= 0.001
    rows[80:120, RATES.start : RATES.start + wheels] = np.nan
    learner = GroundLearner(ROVER, RAMP)
    assert not any((learner.take(row), learner.stuck)[1] for row in rows)
    assert learner.estimate.slip_time is None


def test_a_torque_that_is_the_same_after_a_gap_is_not_frozen():
    rows = climb(ROVER, SLOPE, 12.0)[::5]
    rows[61:, TIME] += 3600.0
    rows[61:64, TORQUES.start] = rows[60, TORQUES.start]
    assert not learn(rows[:64]).estimate.faults


def test_stamps_that_are_not_regular_make_windows_no_longer():
    rows = climb(ROVER, SLOPE, 12.0)[::5]
    regular = learn(rows).window
    rows[:, TIME] += np.random.default_rng(3).uniform(-0.005, 0.005, len(rows))
    assert learn(rows).window.duration == pytest.approx(regular.duration, abs=0.02)


def test_a_drive_after_the_clock_was_set_back_is_learned_as_another_one():
    rows = climb(ROVER, SLOPE, 12.0)[::2]
    again = rows.copy()
    again[:, TIME] -= 100.0
    again[150:, X] = again[150, X]
    learner = learn([*rows, *again])
    assert learner.stuck
    assert learner.estimate.friction.high < 1.5 * SLOPE
    assert learner.estimate.resistance_std > 0.0


def test_a_row_that_another_one_has_overtaken_begins_no_other_drive():
    rows = climb(ROVER, SLOPE, 12.0)
    late = np.arange(5, len(rows) - 1, 7)
    order = np.arange(len(rows))
    order[late], order[late + 1] = late + 1, late
    kept = np.delete(rows, late, axis=0)
    found, expected = (learn(one).estimate.friction for one in (rows[order], kept))
    assert found == expected and found.low > 0.0


def test_nothing_is_learned_from_rows_without_a_pose():
    rows = climb(ROVER, SLOPE, 5.0)
    rows[:, YAW] = np.nan
    assert learn(rows).window is None


@pytest.mark.parametrize(
    ("sensors", "spoil", "word"),
    [
        (TORQUES, lambda one: np.append(one[:20], 0.0 * one[20:] + one[20]), "torque is frozen"),
        (TORQUES, lambda one: 0.0 * one - ROVER.wheel.max_torque, "torque is frozen"),
        (TORQUES, lambda one: np.nan * one, "no torque"),
        (TORQUES, lambda one: -one, "torque has the wrong sign"),
        (RATES, lambda one: np.append(one[:20], 0.0 * one[20:]), "rate is frozen"),
        (RATES, lambda one: -one, "rate has the wrong sign"),
    ],
)
def test_a_bad_sensor_is_told_and_not_believed(sensors, spoil, word):
    rows = climb(ROVER, SLOPE, 20.0)[::5]
    rows[:, sensors.start + 4] = spoil(rows[:, sensors.start + 4])
    estimate = learn(rows).estimate
    assert estimate.faults == {"middle_left": word}
    assert estimate.friction.high is None
    assert estimate.friction.low < 1.2 * SLOPE
    assert abs(estimate.resistance) < 0.1


def test_spikes_of_rates_that_no_motor_has_are_no_slip():
    rows = climb(ROVER, SLOPE, 20.0)[::5]
    spikes = np.random.default_rng(3).random((len(rows), 6)) < 0.01
    rows[:, RATES][spikes] = 300.0
    estimate = learn(rows).estimate
    assert estimate.slip_time is None and estimate.immobilised_time is None
    assert not estimate.faults


def test_a_torque_that_contradicts_the_others_while_a_drive_begins_has_no_wrong_sign():
    rows = climb(ROVER, SLOPE, 1.6)[::5]
    rows[:, TORQUES.start + 4] *= -1.0
    assert not learn(rows).estimate.faults


def test_coarse_rates_whose_last_digit_turns_at_three_wheels_only_are_not_frozen():
    rows, digit = climb(ROVER, SLOPE, 8.0)[::2], 0.05
    rates = 0.4 + 0.004 * np.random.default_rng(4).standard_normal((len(rows), 6))
    rates[:, :3] += 0.5 * digit
    rows[:, RATES] = digit * np.round(rates / digit)
    assert not learn(rows).estimate.faults


def test_a_motor_that_pushes_as_hard_as_it_can_and_stands_has_no_frozen_torque():
    rows = climb(ROVER, SLOPE, 8.0, speed=0.0)[::2]
    rows[:, [TORQUES.start + 2, TORQUES.start + 5]] = ROVER.wheel.max_torque
    learner = learn(rows)
    assert learner.stuck and not learner.estimate.faults


def test_torques_of_a_rover_that_stands_are_not_frozen_because_others_are_missing():
    rows = climb(ROVER, 0.0, 8.0)[::5]
    rows[rows[:, TIME] > 4.0, TORQUES] = 0.0
    rows[:, TORQUES.start : TORQUES.start + 3] = np.nan
    assert set(learn(rows, LEVEL).estimate.faults.values()) == {"no torque"}


def test_torques_that_wheels_apply_to_each_other_on_the_spot_are_no_wrong_signs():
    rows = climb(ROVER, 0.0, 10.0, speed=0.0)
    turn = SteeredDrive(ROVER).aim(0.0, 0.1)
    rows[:, STEERING], rows[:, RATES] = turn.angles, turn.speeds / ROVER.wheel.radius
    rows[:, YAW] += 0.1 * rows[:, TIME]
    rows[:, TORQUES] = 0.1 * ROVER.weight * ROVER.wheel.radius * np.array([0, 0, -1, 1, 0, 0])
    assert not learn(rows, LEVEL).estimate.faults


def test_slip_is_seen_without_any_torque_and_measures_nothing():
    rows = climb(ROVER, SLOPE, 20.0, speed=0.04)[::5]
    rows[:, TORQUES] = np.nan
    rows[rows[:, X] > 0.0, RATES] *= 1.6
    estimate = learn(rows).estimate
    assert estimate.slip_time == pytest.approx(10.5, abs=1.0)
    assert estimate.friction.high is None and estimate.friction.low == 0.0


@pytest.mark.long
def test_friction_and_sticking_are_learned_on_a_slope_that_is_too_steep():
    simulator = pytest.importorskip("rover_planner.simulator.mujoco_rover")
    friction, ground, rows = 0.4, drive_ground("slope", 24.0), []
    plant = simulator.MujocoRover(ROVER, ground, (-0.5, 0.0, 0.0), friction)
    for time in np.arange(0.0, 26.0, 0.02):
        plant.drive(SPEED, 0.0, 0.02)
        rows.append(row_of_plant(plant, time))
    rows = np.array(rows)
    estimate = learn(rows, ground).estimate
    assert estimate.friction.mean == pytest.approx(friction, rel=0.1)
    assert estimate.friction.low < friction < estimate.friction.high
    # It is stuck from where its speed over the next second is below a tenth of the commanded.
    ahead = np.interp(rows[:, TIME] + 1.0, rows[:, TIME], rows[:, X]) - rows[:, X]
    stuck = rows[np.argmax((ahead < 0.1 * SPEED) & (rows[:, TIME] > 5.0)), TIME]
    assert estimate.slip_time is not None
    assert stuck - 1.0 < estimate.immobilised_time < stuck + 2.0
