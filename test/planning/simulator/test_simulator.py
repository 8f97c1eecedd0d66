# SPDX-License-Identifier: Apache-2.0
"""The simulated rover: where it stands, stops, steers and drives, what it sees and follows."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics import SweepOptions, judge_path, load_rover
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.traction.balance import BalanceWriter
from rover_planner.angles import wrap
from rover_planner.errors import PlanningError
from rover_planner.parameters.rover_simulator import RoverSimulatorParameters
from rover_planner.simulator import range_sensor
from rover_planner.simulator.driving_forces import find_driving_forces
from rover_planner.simulator.mujoco_rover import MujocoRover
from rover_planner.simulator.path_follower import PathFollower, SecondTry
from rover_planner.simulator.quasi_static_plant import QuasiStaticPlant
from rover_planner.simulator.simulation import Simulation
from support.grounds import enlarged, make_terrain, plane, raised, rocky, waves
from support.paths import arc_of, poses_at
from support.rovers import FIXED, LSR1, similar

STEP, SPEED = 0.02, 0.06
WAVY, LEVEL = make_terrain(waves, half=3.0), plane(0.0, 0.0, half=3.0)
ENGINES = pytest.mark.parametrize("engine", [QuasiStaticPlant, MujocoRover])


def drive(plant, seconds: float, speed: float = SPEED, yaw_rate: float = 0.0):
    """Drive a plant by a command; return its last state."""
    for _ in range(round(seconds / STEP)):
        plant.drive(speed, yaw_rate, STEP)
    return plant.state()


def pull(plant, seconds: float, torques) -> float:
    """Pull a plant straight ahead with torques [N m]; return where it comes along x [m]."""
    for _ in range(round(seconds / STEP)):
        plant.pull(torques, (SPEED, 0.0), STEP)
    return plant.pose()[0]


def test_the_rover_is_where_the_model_settles_it():
    plant = QuasiStaticPlant(LSR1, WAVY, (-1.0, 0.0, 0.0))
    state = drive(plant, 5.0)
    assert plant.pose() == pytest.approx([-1.0 + 5.0 * 0.06, 0.0, 0.0])
    settled = judge_path(LSR1, WAVY, plant.pose()[None])[0]
    assert state.position == pytest.approx(settled.position[0])
    angles = [state.joint_positions[name] for name in SUSPENSION_JOINTS]
    assert angles == pytest.approx([*settled.rocker_angle[0], *settled.bogie_angle[0]])
    assert state.wheel_torques == pytest.approx(settled.torque[0], abs=0.02)
    turned = np.array([state.joint_positions[name] for name in WHEEL_JOINTS])
    rates = [state.joint_velocities[name] for name in WHEEL_JOINTS]
    assert turned == pytest.approx(np.full(6, 0.3 / LSR1.wheel.radius), rel=0.02)
    assert rates == pytest.approx(np.full(6, 0.6), rel=0.1)


@pytest.mark.parametrize("size", [0.1, 5.0])
def test_a_rover_of_another_size_drives_alike_over_rocks_in_mujoco(size):
    def drive_over_rocks(rover, size):
        plant = MujocoRover(rover, enlarged(rocky(3, half=2.0), size), (-0.6 * size, 0.0, 0.0))
        plant.drive(2.0 * rover.nominal_speed, 0.0, 8.0 * np.sqrt(size))
        return plant.position / size

    there = drive_over_rocks(similar(LSR1, size), size)
    assert there == pytest.approx(drive_over_rocks(LSR1, 1.0), abs=0.015)


def test_no_wheel_turns_faster_than_its_motor_where_it_drops_off_an_edge():
    """Encoders told 45 rad/s then; the traction controller took them for broken."""
    ground = make_terrain(lambda x, y: 0.08 * (x < 0.0) + 0.0 * y, half=2.0, resolution=0.02)
    plant = QuasiStaticPlant(LSR1, ground, (-0.6, 0.0, 0.0), policy="optimal")
    rates, spins = [], [np.zeros(6)]
    for _ in range(500):
        state = drive(plant, STEP, 0.1)
        rates.append([state.joint_velocities[name] for name in WHEEL_JOINTS])
        spins.append([state.joint_positions[name] for name in WHEEL_JOINTS])
    assert plant.pose()[0] > 0.3
    assert np.abs(rates).max() == pytest.approx(LSR1.wheel.max_speed)
    assert np.diff(spins, axis=0) == pytest.approx(STEP * np.array(rates))


@ENGINES
def test_a_command_beyond_the_motors_is_driven_at_their_speed_on_its_curve(engine):
    plant, duration = engine(LSR1, LEVEL, (0.0, 0.0, 0.0)), 6.0
    drive(plant, duration, 1.0, 1.0)
    x, y, yaw = plant.pose()
    fastest = LSR1.wheel.max_speed * LSR1.wheel.radius / np.hypot(1.31, 0.4)  # front right wheel
    assert 0.5 * fastest < yaw / duration < fastest
    assert (x, y) == pytest.approx((np.sin(yaw), 1.0 - np.cos(yaw)), abs=0.02)


def test_it_stops_before_a_wall_and_says_why_and_can_go_back():
    ground = make_terrain(lambda x, y: waves(x, y) + 0.5 * (x > 1.0), half=3.0)
    plant = QuasiStaticPlant(LSR1, ground, (0.4, 0.0, 0.0))
    state = drive(plant, 5.0)
    assert state.stopped and plant.pose()[0] < 1.0
    assert not any(state.joint_velocities.values())
    assert not drive(plant, 1.0, -0.06).stopped


def test_a_start_on_which_no_rover_stands_is_refused():
    with pytest.raises(PlanningError, match="cannot start at"):
        QuasiStaticPlant(LSR1, WAVY, (9.0, 0.0, 0.0))


def test_torques_that_hold_the_slope_keep_the_speed_and_more_drive_it_up():
    ground = plane(np.tan(np.radians(10.0)), 0.0, half=3.0)
    plant = QuasiStaticPlant(LSR1, ground, (-1.0, 0.0, 0.0))
    needed = np.full(6, LSR1.weight * np.sin(np.radians(10.0)) * LSR1.wheel.radius / 6.0)
    assert pull(plant, 1.0, needed) == pytest.approx(-1.0, abs=1e-3)
    high = pull(plant, 1.0, 1.3 * needed)
    assert high > -0.99 and pull(plant, 2.0, 0.5 * needed) < high


def test_across_a_slope_no_wheel_slides_before_all_do():
    slope, friction = 0.53, 0.6
    asked = SweepOptions(friction=friction)
    here = judge_path(LSR1, plane(0.0, slope, half=3.0), np.zeros((1, 3)), asked)[0]
    forces = find_driving_forces(
        BalanceWriter(LSR1), LSR1.wheel.radius, here, np.full(6, 0.02), direction=1.0
    )
    assert not forces.sliding.any()
    assert forces.utilisation == pytest.approx(np.full(6, slope / friction), rel=0.05)


@ENGINES
def test_a_brake_stops_the_rover_and_holds_it_on_a_slope(engine):
    plant = engine(LSR1, plane(-np.tan(np.radians(3.0)), 0.0, half=3.0), (-1.0, 0.0, 0.0))
    pull(plant, 0.5, np.zeros(6))
    assert plant.state().velocity[0] > 0.05
    places = []
    for _ in range(100):
        plant.brake(STEP)
        places.append(plant.pose()[0])
    assert places[-1] - places[50] < 1e-3  # 0.25 m without the brake
    assert np.abs(list(plant.state().joint_velocities.values())).max() < 0.01
    pull(plant, STEP, np.full(6, 0.5))
    assert plant.state().velocity[0] > 0.01


def test_a_rover_that_stands_is_not_computed_again_and_nothing_else_changes(monkeypatch):
    rover = load_rover("m2020")
    most, ground = rover.wheel.max_torque, plane(0.2, 0.0, half=8.0)
    plant, full = (QuasiStaticPlant(rover, ground, (0.0, 0.0, 0.3)) for _ in range(2))
    monkeypatch.setattr(full, "_repeats", lambda *step: False)
    rng, same = np.random.default_rng(1), 0
    for _ in range(12):
        torques, command = rng.choice([0.0, 0.6 * most, most], 6), (rng.choice([0.0, 0.03]), 0.0)
        step = rng.choice(["drive", "pull", "brake"], p=[0.3, 0.5, 0.2])
        given = {"drive": command, "pull": (torques, command), "brake": ()}[step]
        for _ in range(rng.choice([1, 4, 20])):
            before = plant.state()
            for one in (plant, full):
                getattr(one, step)(*given, 0.02)
            full._measured = None
            same += plant.state() is before
            assert all(
                np.array_equal(value, getattr(full.state(), field))
                for field, value in vars(plant.state()).items()
            )
    assert same > 15


@pytest.mark.parametrize("nominal", [0.003, 0.03, 1.0])
@pytest.mark.parametrize("share", [0.2, 0.5])
def test_a_rover_stays_if_it_is_much_slower_than_its_own_speed(nominal, share):
    """One motor saturates all the time, and the others brake against it."""
    wheel = replace(LSR1.wheel, max_torque=0.5, max_speed=20.0)
    rover = replace(LSR1, wheel=wheel, nominal_speed=nominal)
    plant, against = QuasiStaticPlant(rover, LEVEL, (-2.0, 0.0, 0.0)), np.append(0.5, [-0.1] * 5)
    for _ in range(150):
        error = share * nominal - plant.state().velocity[0]
        push = 2.0 * rover.total_mass * error * rover.wheel.radius
        plant.pull(against + np.append(0.0, [push / 5.0] * 5), (nominal, 0.0), STEP)
    assert plant.state().velocity[0] == pytest.approx(share * nominal, rel=0.3)
    assert ("stay" in plant.state().stopped) == (share < 1.0 / 3.0)


def test_drives_without_commands_are_braked():
    given = RoverSimulatorParameters(follow_commands=True, start_x=-1.0)
    slope = plane(-np.tan(np.radians(3.0)), 0.0, half=3.0)
    simulation = Simulation(LSR1, slope, given)

    def roll(begin):
        return [simulation.advance(begin + STEP * k, STEP).velocity[0] for k in range(25)][-1]

    assert roll(0.0) == 0.0  # the controller is not ready yet
    simulation.take_torques(np.zeros(6), 1.0)
    assert roll(1.0) > 0.0
    simulation.take_brake(True)
    assert roll(1.0) == 0.0
    simulation.take_brake(False)
    assert roll(2.0) == 0.0  # the controller has died


def test_a_path_waits_while_the_watch_stops_the_rover_or_is_silent():
    given = RoverSimulatorParameters(start_x=-1.0, stop_timeout=0.4)
    simulation = Simulation(LSR1, WAVY, given)
    simulation.take_path(np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))

    def speeds(begin, seconds):
        times = begin + STEP * np.arange(round(seconds / STEP))
        return [simulation.advance(now, STEP).velocity[0] for now in times]

    assert not any(speeds(0.0, 1.0))
    simulation.take_stop(False, 1.0)
    moving = speeds(1.0, 1.0)
    assert all(moving[1:20]) and not any(moving[22:])
    assert not any(speeds(2.0, 20.0))
    simulation.take_stop(False, 22.0)
    assert min(speeds(22.0, 0.3)[1:]) > 0.0  # it does not back off: it was not stuck
    simulation.take_stop(True, 22.3)
    assert not any(speeds(22.3, 0.2)[1:])


def test_both_engines_drive_the_same_way():
    start = (-1.0, 0.2, 0.0)
    still, moving = QuasiStaticPlant(LSR1, WAVY, start), MujocoRover(LSR1, WAVY, start)
    states = [drive(plant, 3.0) for plant in (still, moving)]
    assert states[1].position == pytest.approx(states[0].position, abs=0.04)
    for name in SUSPENSION_JOINTS:
        angles = [state.joint_positions[name] for state in states]
        assert angles[1] == pytest.approx(angles[0], abs=0.03)
    assert states[1].orientation == pytest.approx(states[0].orientation, abs=0.03)


def drive_against_a_wall(follower, wall, duration, nominal=0.1):
    """Return positions and speeds along x of a rover that a wall stops `wall(attempt)` m ahead."""
    x, attempt, track = 0.0, 0, []
    for step in range(int(duration / 0.1)):
        speed, _ = follower.steer(np.array([x, 0.0, 0.0]), nominal, 0.1 * step)
        attempt += bool(track) and speed < 0.0 <= track[-1][1]
        x = min(x + 0.1 * speed, max(wall(attempt), x + min(0.1 * speed, 0.0)))
        track.append((x, speed))
    return np.array(track)


@pytest.mark.parametrize("wall_falls", [True, False])
def test_a_rover_that_stands_still_backs_off_twice_and_then_gives_up(wall_falls):
    path = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    follower = SecondTry(PathFollower(path, 0.4), LSR1.wheel.radius)
    passed = 2 if wall_falls else np.inf
    track = drive_against_a_wall(follower, lambda tries: 0.5 if tries < passed else 9.0, 90.0)
    assert follower.retries == 2 and follower.given_up != wall_falls
    assert follower.has_arrived(np.array([track[-1, 0], 0.0, 0.0])) == wall_falls
    assert wall_falls or (not track[-1, 1] and track[:, 0].max() == pytest.approx(0.5))


@pytest.mark.parametrize("size", [0.3, 1.0, 2.6])
@pytest.mark.parametrize("nominal", [0.1, 0.01])
def test_a_rover_of_any_size_and_speed_backs_off_by_as_many_wheel_radii(size, nominal):
    radius, wall = 0.1 * size, 0.3 * size
    path = size * np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    follower = SecondTry(PathFollower(path, 0.4 * size), radius)
    track = drive_against_a_wall(follower, lambda _: wall, 70.0, nominal * size)[:, 0]
    backed = wall - track[np.argmax(track >= wall - 1e-9) :].min()
    assert backed == pytest.approx(1.2 * radius, abs=0.11 * nominal * size)


def test_the_ground_goes_on_where_a_file_does_not_know_it_and_the_sensor_does_not_see_it():
    ground = raised(WAVY, np.s_[55:66, 55:66], np.nan)
    given = RoverSimulatorParameters(start_x=-0.6)
    simulation = Simulation(LSR1, ground, given)
    drive(simulation.plant, 13.0)
    assert simulation.plant.pose()[0] > 0.1  # a server that interpolates has let it pass
    assert np.isnan(simulation.look(simulation.plant.state().position, 0.0).elevation_at(0.0, 0.0))


def look(ground, **changes):
    values = {"range": 2.0, "noise": 0.0, "height": 0.8, "occlusion": True} | changes
    asked = RoverSimulatorParameters(**{f"sensor_{key}": value for key, value in values.items()})
    position, rng = np.array([0.0, 0.0, 0.3]), np.random.default_rng(1)
    return range_sensor.look(asked, ground, position, 0.0, rng)


def test_the_sensor_sees_the_ground_in_its_range_and_no_farther():
    ground = make_terrain(waves, half=4.0)
    seen = look(ground)
    y, x = np.indices(seen.elevation.shape)
    away = np.hypot(seen.origin[0] + seen.resolution * x, seen.origin[1] + seen.resolution * y)
    known = np.isfinite(seen.elevation)
    assert known[away < 1.9].all()
    assert not known[away > 2.0].any()
    there = ground.elevation_at(
        seen.origin[0] + seen.resolution * x[known], seen.origin[1] + seen.resolution * y[known]
    )
    assert seen.elevation[known] == pytest.approx(there)


def test_a_wall_hides_what_is_behind_it_unless_nothing_hides():
    ground = make_terrain(lambda x, y: 2.0 * ((x > 0.8) & (x < 1.0)) + 0.0 * y, half=4.0)
    seen = look(ground)
    assert np.isnan(seen.elevation_at(1.5, 0.0))
    assert np.isfinite(seen.elevation_at(0.5, 0.0))
    assert np.isfinite(seen.elevation_at(-1.5, 0.0))
    assert np.isfinite(look(ground, occlusion=False).elevation_at(1.5, 0.0))


# Wheels that steer

LOOK_AHEAD = 0.4
REACH = float(np.hypot(0.4, 0.31))


def turn_and_go(angle, length):
    spot = poses_at(0.0, 0.0, np.linspace(0.0, angle, 40))
    return np.vstack([spot, arc_of(0.0, np.linspace(0.0, length, 40), angle)[1:]])


def drive_along(plant, path):
    """Follow a path; return the largest distance from it [m], and all poses and states."""
    follower, poses, states = PathFollower(path, LOOK_AHEAD, REACH), [], []
    while not follower.has_arrived(plant.pose()):
        plant.drive(*follower.steer(plant.pose(), SPEED), STEP)
        poses.append(plant.pose())
        states.append(plant.state())
        assert len(poses) < 3000 and not states[-1].stopped
    away = [np.hypot(*(path[:, :2] - pose[:2]).T).min() for pose in poses]
    return max(away), np.array(poses), states


@pytest.mark.parametrize(("engine", "side"), [(QuasiStaticPlant, 1.0), (MujocoRover, -1.0)])
def test_a_curve_is_driven_with_its_wheels_turned(engine, side):
    plant = engine(LSR1, LEVEL, (0.0, 0.0, 0.0))
    path = arc_of(side / 1.2, np.linspace(0.0, 0.72, 100))
    away, poses, states = drive_along(plant, path)
    assert away < 0.02
    assert poses[-1][:2] == pytest.approx(path[-1, :2], abs=0.25 * LOOK_AHEAD + 0.01)
    angles = [state.joint_positions for state in states]
    inner = np.arctan2(0.4, 1.2 - 0.31)
    front = "front_left_steering" if side > 0.0 else "front_right_steering"
    assert side * np.median([at[front] for at in angles]) == pytest.approx(inner, abs=0.03)
    for at in angles:
        assert at[front] == pytest.approx(-at[front.replace("front", "rear")], abs=0.02)


def test_a_turn_on_the_spot_goes_the_way_of_the_path_stays_there_and_the_drive_goes_on():
    plant, path = QuasiStaticPlant(LSR1, LEVEL, (0.0, 0.0, 0.0)), turn_and_go(4.0, 0.2)
    path[:, 2] = wrap(path[:, 2])  # more than half a circle
    away, poses, _ = drive_along(plant, path)
    assert away < 0.03
    turned = np.unwrap(poses[:, 2])
    assert (np.diff(turned) > -1e-3).all() and turned[-1] == pytest.approx(4.0, abs=0.03)
    assert np.abs(poses[turned < 3.9, :2]).max() < 0.02


@ENGINES
def test_a_curve_beyond_the_limit_stops_the_rover_with_the_wheel(engine):
    narrow = replace(LSR1, steering=replace(LSR1.steering, limit=0.4))
    plant = engine(narrow, LEVEL, (0.0, 0.0, 0.0))
    assert "wheel needs a steering angle of" in drive(plant, 0.4, 0.0, 0.1).stopped
    assert not drive(plant, 1.0).stopped and plant.pose()[0] > 0.02


@ENGINES
def test_fixed_wheels_have_no_steering_joints_and_skid_in_curves(engine):
    plant = engine(FIXED, LEVEL, (0.0, 0.0, 0.0))
    state = drive(plant, 4.0, SPEED, SPEED)
    assert not set(STEERING_JOINTS) & set(state.joint_positions)
    assert plant.pose()[2] > 0.05
    right, left = (state.joint_velocities[f"middle_{side}_wheel"] for side in ("right", "left"))
    assert right > 1.5 * left


def test_a_change_from_forwards_to_backwards_is_driven_to_its_corner():
    plant = QuasiStaticPlant(LSR1, LEVEL, (0.0, 0.0, 0.0))
    back = np.array([1.0, 0.0, 0.0]) + arc_of(-1.0, np.linspace(0.0, -0.8, 100))  # to the right
    path = np.vstack([poses_at(np.linspace(0.0, 1.0, 30)), back[1:]])
    away, poses, _ = drive_along(plant, path)
    assert away < 0.1
    corner = np.argmax(poses[:, 0])
    assert poses[corner, 0] == pytest.approx(1.0, abs=0.08)
    assert (np.diff(poses[:corner, 0]) >= 0.0).all() and (np.diff(poses[corner:, 0]) <= 0.0).all()
    assert np.hypot(*(poses[-1, :2] - path[-1, :2])) < 0.1


def test_a_rover_that_stands_while_it_steers_is_given_its_time():
    path = PathFollower(turn_and_go(0.5, 1.0), LOOK_AHEAD, REACH)
    follower = SecondTry(path, LSR1.wheel.radius, patience=30.0)
    for step in range(299):
        assert follower.steer(np.zeros(3), SPEED, 0.1 * step) != (-SPEED, 0.0)
    assert not follower.retries
    for step in range(299, 310):
        follower.steer(np.zeros(3), SPEED, 0.1 * step)
    assert follower.retries == 1
