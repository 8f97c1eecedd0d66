"""Equilibrium: the nine balance equations hold, loads are MuJoCo's, and Figure 4 of the paper."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rover_physics.forces.equilibrium import balance_forces
from rover_physics.prediction.evaluation import new_work
from rover_physics.prediction.sweep import sweep_path, sweep_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.linkage import pack_linkage, place, place_masses
from rover_physics.rover.model import Part, Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain
from support.reference_cases import reference_grounds, reference_predictions
from support.rough_grounds import fractal, mirrored, plane, random_poses, rocky, smooth
from support.rover_geometry import attitude_of, balance_residuals, turned_round

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
SWAP = [3, 4, 5, 0, 1, 2]
ROUND = [5, 4, 3, 2, 1, 0]
seeds = st.integers(0, 10_000)
headings = st.floats(-np.pi, np.pi)
few = settings(max_examples=25, deadline=None)


def scaled_for(rover: Rover, ground: Terrain) -> Terrain:
    """Return `ground` as large for `rover` as it is for lsr1."""
    size = rover.wheel.radius / LSR1.wheel.radius
    x, y = ground.origin
    return Terrain(ground.elevation * size, ground.resolution * size, (x * size, y * size))


def scaled_poses(rover: Rover, poses: np.ndarray) -> np.ndarray:
    size = rover.wheel.radius / LSR1.wheel.radius
    return poses * [size, size, 1.0]


# Against the reference


def total_loads(prediction) -> np.ndarray:
    parts = [prediction.wheel_loads, prediction.tangential, prediction.lateral]
    return np.sqrt(sum(part**2 for part in parts))


def test_the_forces_on_the_wheels_are_those_of_mujoco():
    errors = [
        np.abs(total_loads(prediction) - np.linalg.norm(case.forces, axis=2)).ravel()
        for case, prediction in reference_predictions()
    ]
    errors = np.concatenate(errors) / LSR1.weight
    assert errors.size == 81 * 6
    assert np.median(errors) <= 0.005
    assert np.percentile(errors, 95) <= 0.015


# The balance


@few
@given(headings, st.floats(0.5, 25.0), st.floats(-0.1, 0.1), st.floats(-0.1, 0.1))
def test_on_level_ground_the_loads_sum_to_the_weight(yaw, gravity, com_x, com_y):
    body = Part(LSR1.masses.body.mass, (com_x, com_y, 0.05))
    rover = replace(LSR1, gravity=gravity, masses=replace(LSR1.masses, body=body))
    prediction = sweep_path(rover, plane(0.0, 0.0), [[0.0, 0.0, yaw]])
    assert prediction.wheel_loads.sum() == pytest.approx(rover.weight, rel=1e-9)
    assert np.abs(prediction.tangential).max() <= 1e-9 * rover.weight
    assert np.abs(prediction.lateral).max() <= 1e-9 * rover.weight
    lever = prediction.contact_points[0] - prediction.position[0]
    across = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    share = body.mass * rover.gravity * com_y
    assert prediction.wheel_loads[0] @ (lever @ across) == pytest.approx(share, abs=1e-8)


@pytest.mark.parametrize("policy", ["equal", "optimal"])
@pytest.mark.parametrize("make", [smooth, fractal, rocky])
@pytest.mark.parametrize(
    "rover", [LSR1, M2020, turned_round(LSR1), turned_round(M2020)], ids=lambda rover: rover.name
)
def test_all_nine_balance_equations_hold_on_rough_ground(rover, make, policy):
    poses = scaled_poses(rover, random_poses(5, 40, 0.5))
    prediction = sweep_path(rover, scaled_for(rover, make(7)), poses, SweepOptions(policy=policy))
    assert prediction.settled.mean() >= 0.95
    residuals = [
        balance_residuals(rover, prediction, i) for i in np.flatnonzero(prediction.settled)
    ]
    assert np.abs(residuals).max() <= 1e-9


@few
@given(seeds, headings, st.floats(1.0, 20.0))
def test_all_nine_balance_equations_hold_under_any_gravity(seed, yaw, gravity):
    rover = replace(LSR1, gravity=gravity)
    prediction = sweep_path(rover, smooth(seed), [[0.1, 0.2, yaw]])
    assert np.abs(balance_residuals(rover, prediction, 0)).max() <= 1e-9


def test_all_nine_balance_equations_hold_in_the_reference_cases():
    worst = [
        np.abs(balance_residuals(LSR1, prediction, i)).max()
        for _, prediction in reference_predictions()
        for i in range(len(prediction.poses))
    ]
    assert max(worst) <= 1e-9


def test_up_a_plane_the_pull_carries_the_weight_along_it():
    slope = np.tan(0.2)
    up, down, across = (
        sweep_path(LSR1, plane(slope, 0.0), [[0.0, 0.0, yaw]]) for yaw in (0.0, np.pi, np.pi / 2)
    )
    along = LSR1.weight * np.sin(0.2)
    normal = LSR1.weight * np.cos(0.2)
    for prediction, pull, side in ((up, along, 0.0), (down, -along, 0.0), (across, 0.0, -along)):
        assert prediction.wheel_loads.sum() == pytest.approx(normal, rel=1e-5)
        assert prediction.tangential.sum() == pytest.approx(pull, abs=1e-5 * along)
        assert prediction.lateral.sum() == pytest.approx(side, abs=1e-5 * along)


@few
@given(seeds)
def test_equal_torques_are_equal_and_lateral_forces_linear_along_the_rover(seed):
    prediction = sweep_poses(LSR1, rocky(seed % 20), random_poses(seed, 3, 1.5), np.zeros(3))
    for i in np.flatnonzero(prediction.settled):
        T, S = prediction.tangential[i], prediction.lateral[i]
        assert pytest.approx(np.full(6, T[0]), abs=1e-12 * LSR1.weight) == T
        ahead = attitude_of(prediction, i)[:, 0]
        along = (prediction.wheel_centres[i] - prediction.position[i]) @ ahead
        left = S - np.polyval(np.polyfit(along, S, 1), along)
        assert np.abs(left).max() <= 1e-9 * LSR1.weight


# Torque, friction, slip


def test_torque_is_traction_times_radius_and_saturation_its_share_of_the_largest():
    for _, prediction in reference_predictions():
        assert prediction.torque == pytest.approx(0.1 * prediction.tangential, abs=1e-12)
        assert prediction.torque_saturation == pytest.approx(
            np.abs(prediction.torque) / LSR1.wheel.max_torque, abs=1e-12
        )


def test_half_the_largest_torque_saturates_twice_as_much():
    case = reference_grounds()[5]
    full = sweep_path(LSR1, case.terrain, case.poses, SweepOptions(max_torque=2.0))
    half = sweep_path(LSR1, case.terrain, case.poses, SweepOptions(max_torque=1.0))
    assert full.torque_saturation.max() > 0.0
    assert half.torque_saturation == pytest.approx(2.0 * full.torque_saturation)


def test_friction_utilisation_is_the_share_of_coulomb_friction():
    for _, prediction in reference_predictions():
        shear = np.hypot(prediction.tangential, prediction.lateral)
        carried = prediction.wheel_loads > 0.0
        expected = shear[carried] / (0.8 * prediction.wheel_loads[carried])
        assert prediction.friction_utilisation[carried] == pytest.approx(expected)
        assert np.isinf(prediction.friction_utilisation[~carried]).all()


@few
@given(st.floats(0.05, 2.0), st.floats(-0.3, 0.3))
def test_twice_the_friction_is_used_half_as_much_under_the_same_loads(mu, slope):
    ground, pose = plane(slope, 0.1), [[0.0, 0.0, 0.3]]
    once = sweep_path(LSR1, ground, pose, SweepOptions(friction=mu))
    twice = sweep_path(LSR1, ground, pose, SweepOptions(friction=2.0 * mu))
    assert twice.friction_utilisation == pytest.approx(0.5 * once.friction_utilisation)
    assert twice.wheel_loads.tolist() == once.wheel_loads.tolist()


def test_a_wheel_that_needs_more_than_its_friction_spins():
    slope = np.tan(0.35)
    grip = sweep_path(LSR1, plane(slope, 0.0), [[0.0, 0.0, 0.0]], SweepOptions(friction=1.0))
    slide = sweep_path(LSR1, plane(slope, 0.0), [[0.0, 0.0, 0.0]], SweepOptions(friction=0.1))
    assert (grip.friction_utilisation < 1.0).all()
    assert (grip.slip_ratio < 1.0).all()
    assert (slide.friction_utilisation > 1.0).all()
    assert (slide.slip_ratio == 1.0).all()


def test_the_friction_of_the_ground_goes_before_that_of_the_rover():
    ground = plane(0.1, 0.0)
    friction = np.full(ground.elevation.shape, np.nan)
    friction[: friction.shape[0] // 2] = 0.25
    prediction = sweep_path(LSR1, replace(ground, friction=friction), [[0.0, 0.0, 0.0]])
    assert prediction.friction[0].tolist() == [0.25] * 3 + [0.8] * 3


# Symmetries, other rovers


@few
@given(seeds)
def test_mirrored_ground_swaps_the_loads_of_right_and_left(seed):
    ground, poses = smooth(seed), random_poses(seed, 4, 0.6)
    here = sweep_poses(LSR1, ground, poses, np.zeros(4))
    there = sweep_poses(LSR1, *mirrored(ground, poses), np.zeros(4))
    loose = 1e-3 * LSR1.weight
    assert there.wheel_loads == pytest.approx(here.wheel_loads[:, SWAP], abs=loose)
    assert there.tangential == pytest.approx(here.tangential[:, SWAP], abs=loose)
    assert there.lateral == pytest.approx(-here.lateral[:, SWAP], abs=loose)


@few
@given(seeds, st.floats(0.1, 10.0))
def test_forces_grow_with_gravity_in_proportion(seed, factor):
    ground, poses = fractal(seed % 20), random_poses(seed, 4, 1.5)
    here = sweep_poses(LSR1, ground, poses, np.zeros(4))
    heavy = replace(LSR1, gravity=factor * LSR1.gravity)
    there = sweep_poses(heavy, ground, poses, np.zeros(4))
    for name in ("wheel_loads", "tangential", "lateral", "torque"):
        scaled = factor * getattr(here, name)
        assert getattr(there, name) == pytest.approx(scaled, rel=1e-9, nan_ok=True), name
    assert there.friction_utilisation == pytest.approx(
        here.friction_utilisation, rel=1e-9, nan_ok=True
    )


@few
@given(seeds, st.sampled_from([LSR1, M2020]))
def test_a_bogie_behind_is_a_bogie_ahead_driven_backwards(seed, rover):
    rover = replace(rover, manipulator=None)
    ground = scaled_for(rover, smooth(seed))
    poses = scaled_poses(rover, random_poses(seed, 3, 0.5))
    here = sweep_poses(rover, ground, poses, np.zeros(3))
    there = sweep_poses(
        turned_round(rover), ground, poses + np.array([0.0, 0.0, np.pi]), np.zeros(3)
    )
    assert here.settled.all()
    assert there.settled.all()
    size = rover.wheel.radius
    assert there.position == pytest.approx(here.position, abs=1e-4 * size)
    assert there.wheel_centres == pytest.approx(here.wheel_centres[:, ROUND], abs=1e-3 * size)
    loose = 1e-3 * rover.weight
    assert there.wheel_loads == pytest.approx(here.wheel_loads[:, ROUND], abs=loose)
    assert there.tangential == pytest.approx(-here.tangential[:, ROUND], abs=loose)
    assert there.lateral == pytest.approx(-here.lateral[:, ROUND], abs=loose)
    assert there.tip_over_ratio == pytest.approx(here.tip_over_ratio, abs=1e-3)


# Figure 4


def load_changes(rover: Rover, torques: list[float]) -> np.ndarray:
    """Return how the loads (6,) [N] on flat ground change with torques on both sides.

    Args:
        rover: The rover.
        torques: Changes of the rear, middle and front torque [N m].
    """
    body = rover.masses.body
    linkage = pack_linkage(rover, body.mass, np.array(body.com))
    work, q = new_work(), np.zeros(6)
    place(linkage, work.pose, q, work.placement)
    place_masses(linkage, q, work.placement)
    work.contacts.sine[:], work.contacts.cosine[:] = 0.0, 1.0
    work.contacts.point[:] = work.placement.centres - [0.0, 0.0, rover.wheel.radius]
    assert balance_forces(linkage, work.placement, work.contacts, 6, work.balance)
    pulls = np.array(torques * 2) / rover.wheel.radius
    relative = pulls[:5] - pulls[5]
    assert work.balance.tangential[:, 1:6] @ relative == pytest.approx(pulls, abs=1e-9)
    return work.balance.normal[:, 1:6] @ relative


@pytest.mark.parametrize(
    ("torques", "changes"),
    [
        ([-0.2, 0.2, 0.0], [-0.733, 1.467, -0.733]),
        ([-0.2, 0.0, 0.2], [-0.733, 1.467, -0.733]),
        ([0.0, -0.2, 0.2], [0.0, 0.0, 0.0]),
    ],
)
def test_torques_change_loads_as_in_figure_4(torques, changes):
    loads = load_changes(LSR1, torques)
    assert loads == pytest.approx(np.array(changes * 2), abs=0.0005)
    assert loads.sum() == pytest.approx(0.0, abs=1e-9)


def test_in_figure_4_opposite_torques_change_loads_oppositely():
    there, back = load_changes(LSR1, [-0.2, 0.2, 0.0]), load_changes(LSR1, [0.2, -0.2, 0.0])
    assert there == pytest.approx(-back)
    assert np.abs(there).max() > 1.0
