"""Policy "servo": the nine equations hold, and rovers with speed servos do what they must."""

from dataclasses import replace

import numpy as np
import pytest

from rover_physics.errors import ModelError
from rover_physics.forces.servo import CREEP, write_residual
from rover_physics.prediction.evaluation import evaluate_pose, new_results, new_works, set_pose
from rover_physics.prediction.map_sweep import score_poses
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.sweep import sweep_path, sweep_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from support.rough_grounds import fractal, mirrored, plane, random_poses, rocky
from support.rover_geometry import balance_residuals

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
FIXED = replace(LSR1, steering=None)
SERVO = SweepOptions(policy="servo")
POSE = np.zeros((1, 3))
SWAP = [3, 4, 5, 0, 1, 2]


def with_droop(rover, droop):
    return replace(rover, wheel=replace(rover.wheel, servo_droop=droop))


def servo_at(rover, ground, poses, options, curvature=None):
    """Yield the SERVO at each pose that settles and drives."""
    model = pack_model(rover, ground, options)
    motions = motions_of(model, poses, curvature)
    work, result = new_works(1, 1)[0], new_results(1)[0]
    for i in range(len(poses)):
        set_pose(model.record, poses, motions, i, work)
        evaluate_pose(model.record, work, result)
        if result.status == 0 and result.speed_share > 0.0:
            yield work.servo


@pytest.mark.parametrize("rover", [LSR1, FIXED], ids=["steered", "fixed"])
@pytest.mark.parametrize("curvature", [0.0, 0.8, np.inf])
def test_the_nine_equations_hold(rover, curvature):
    poses = random_poses(1, 40, 2.0)
    servos = servo_at(rover, rocky(1), poses, SERVO, np.full(40, curvature))
    sizes = [write_residual(servo, servo.z) for servo in servos]
    assert len(sizes) >= 25
    assert max(sizes) <= 2e-7


def test_without_turning_the_forces_balance_by_an_independent_model():
    ground, x = fractal(3), np.linspace(-1.5, 1.5, 30)
    path = np.column_stack([x, 0.0 * x, 0.0 * x])
    narrow = replace(LSR1, wheel=replace(LSR1.wheel, width=1e-3))  # no scrub
    prediction = sweep_path(narrow, ground, path, SERVO)
    assert prediction.settled.all() and (prediction.speed_share > 0.5).all()
    for i in range(len(x)):
        residuals = balance_residuals(narrow, prediction, i)
        assert max(np.abs(r).max() for r in residuals) <= 1e-2 * narrow.weight / 6.0


def test_the_jacobian_is_that_of_finite_differences():
    poses = random_poses(2, 12, 2.0)
    for servo in servo_at(FIXED, rocky(2), poses, SERVO, np.full(12, 0.7)):
        z = servo.z * (1.0 + 0.03 * np.sin(np.arange(9))) + 0.01
        write_residual(servo, z)
        J, found = servo.J.copy(), np.empty((9, 9))
        for k in range(9):
            ends = []
            for sign in (1.0, -1.0):
                write_residual(servo, z + sign * 1e-7 * np.eye(9)[k])
                ends.append(servo.residual[:, 0].copy())
            found[:, k] = (ends[0] - ends[1]) / 2e-7
        np.testing.assert_allclose(J, found, atol=1e-3 * np.abs(found).max())


def test_on_level_ground_straight_ahead_nothing_slips():
    level = sweep_path(LSR1, plane(0.0, 0.0), POSE, SERVO)
    equal = sweep_path(LSR1, plane(0.0, 0.0), POSE)
    np.testing.assert_allclose(level.wheel_loads, equal.wheel_loads, rtol=1e-6)
    np.testing.assert_allclose(level.torque, 0.0, atol=1e-6)
    np.testing.assert_allclose(level.slip_ratio, 0.0, atol=1e-6)
    assert level.speed_share[0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("slope", [0.1, 0.3])
def test_uphill_the_speed_lost_is_that_of_droop_and_creep(slope):
    found = sweep_path(with_droop(LSR1, 0.3), plane(slope, 0.0), POSE, SERVO)
    saturation = found.torque_saturation[0].mean()
    assert 1.0 - found.speed_share[0] == pytest.approx(0.3 * saturation, abs=0.03)
    stiff = sweep_path(with_droop(LSR1, 0.0), plane(slope, 0.0), POSE, SERVO)
    assert 1.0 - stiff.speed_share[0] <= 3.0 * CREEP
    weight_along = LSR1.weight * np.sin(np.arctan(slope))
    assert found.tangential.sum() == pytest.approx(weight_along, rel=1e-5)


def test_backward_is_forward_turned_round_on_level_ground_and_downhill():
    down = sweep_path(LSR1, plane(0.2, 0.0), POSE, replace(SERVO, backward=True))
    assert down.tangential.sum() == pytest.approx(LSR1.weight * np.sin(np.arctan(0.2)), rel=1e-5)
    assert down.speed_share[0] > 1.0  # gravity pulls, and droop lets it
    assert (down.slip_ratio < 0.0).all()


@pytest.mark.parametrize("curvature", [0.0, 0.5, np.inf])
def test_mirrored_ground_mirrored_result(curvature):
    ground, poses = rocky(5), random_poses(5, 25, 2.0)
    other, flipped = mirrored(ground, poses)
    bends = np.full(25, curvature)
    one = sweep_poses(FIXED, ground, poses, bends, SERVO)
    two = sweep_poses(FIXED, other, flipped, -bends, SERVO)
    both = (one.speed_share > 0.0) & (two.speed_share > 0.0)
    assert both.sum() >= 15
    np.testing.assert_allclose(
        one.wheel_loads[both], two.wheel_loads[both][:, SWAP], atol=1e-3 * LSR1.weight
    )
    np.testing.assert_allclose(one.torque[both], two.torque[both][:, SWAP], atol=2e-2)


@pytest.mark.parametrize("slope", [0.0, 0.1, 0.25, 0.4])
def test_uphill_more_friction_never_lowers_the_speed(slope):
    shares = [
        sweep_path(LSR1, plane(slope, 0.1), POSE, replace(SERVO, friction=mu)).speed_share[0]
        for mu in np.linspace(0.2, 1.5, 27)
    ]
    assert (np.diff(shares) >= -1e-6).all()
    assert shares[-1] > 0.5


def test_more_friction_or_torque_never_stops_the_rover_on_rough_ground():
    ground, poses = fractal(7, roughness=0.1), random_poses(7, 150, 2.0)
    for steps in (
        [replace(SERVO, friction=mu) for mu in (0.2, 0.3, 0.5, 0.8, 1.2)],
        [replace(SERVO, max_torque=tau) for tau in (0.3, 0.6, 1.0, 2.0, 4.0)],
    ):
        drives = np.array([sweep_path(LSR1, ground, poses, o).speed_share > 0.0 for o in steps])
        assert drives[0].mean() < drives[-1].mean()
        assert drives[-1].mean() > 0.9
        assert not (drives[:-1] & ~drives[1:]).any()


def wide(rover, factor):
    """Return a rover that is `factor` times as wide."""

    def moved(point):
        return (point[0], point[1] * factor, point[2])

    suspension, masses = rover.suspension, rover.masses
    return replace(
        rover,
        suspension=replace(
            suspension,
            rocker_pivot=moved(suspension.rocker_pivot),
            bogie_pivot=moved(suspension.bogie_pivot),
            wheels={name: moved(place) for name, place in suspension.wheels.items()},
        ),
        masses=replace(
            masses,
            rocker=replace(masses.rocker, com=moved(masses.rocker.com)),
            bogie=replace(masses.bogie, com=moved(masses.bogie.com)),
        ),
    )


@pytest.mark.parametrize("curvature", [0.5, np.inf])
def test_a_turn_of_fixed_wheels_meets_the_textbook_moment_of_resistance(curvature):
    """Lateral friction at each wheel: M = sum of mu N |x_i - x_c| (Wong, section 6.1).

    The formula takes the wheels to slide across their headings alone, as on a vehicle that is wide
    for its length; x_c is the centre of turning along x, where the lateral forces cancel.
    """
    rover = replace(wide(FIXED, 4.0), wheel=replace(FIXED.wheel, width=1e-3))  # no scrub
    found = sweep_poses(rover, plane(0.0, 0.0, half=2.5), POSE, [curvature], SERVO)
    x, y = (found.contact_points[0] - found.position[0])[:, :2].T
    N, T, S = found.wheel_loads[0], found.tangential[0], found.lateral[0]
    drive = -(y * T).sum()
    mu_N, ends = 0.8 * N, np.abs(x) > 0.2
    centre = np.interp(0.0, [-mu_N[x < -0.2].sum(), mu_N[x > 0.2].sum()], [-0.4, 0.4])
    textbook = (mu_N * np.abs(x - centre))[ends].sum()
    assert drive == pytest.approx(-(-(x * S)).sum(), rel=1e-5) or drive > 0.0
    assert drive == pytest.approx(textbook, rel=0.05)


def test_a_turn_on_the_spot_with_steered_wheels_needs_little_torque():
    steered = sweep_poses(LSR1, plane(0.0, 0.0), POSE, [np.inf], SERVO)
    fixed = sweep_poses(FIXED, plane(0.0, 0.0), POSE, [np.inf], SERVO)
    assert np.abs(steered.torque).max() < 0.15 * np.abs(fixed.torque).max()
    assert steered.speed_share[0] > 0.95 > fixed.speed_share[0]


def test_a_slope_beyond_friction_slides_and_one_beyond_the_motors_stalls():
    slides = sweep_path(LSR1, plane(0.45, 0.0), POSE, replace(SERVO, friction=0.4))
    stalls = sweep_path(LSR1, plane(0.3, 0.0), POSE, replace(SERVO, max_torque=0.2))
    assert (slides.speed_share[0], slides.stalls[0]) == (0.0, 0.0)
    assert (stalls.speed_share[0], stalls.stalls[0]) == (0.0, 1.0)


def test_a_cross_slope_beyond_friction_slides():
    slides = sweep_path(LSR1, plane(0.0, 0.5), POSE, replace(SERVO, friction=0.4))
    holds = sweep_path(LSR1, plane(0.0, 0.3), POSE, replace(SERVO, friction=0.4))
    assert slides.speed_share[0] == 0.0
    assert holds.speed_share[0] > 0.9
    assert -0.1 < holds.deviation[0, 1] < 0.0  # a creep downhill


def test_the_limits_of_friction_and_torque_are_kept():
    limits = replace(LSR1.limits, friction_utilisation=0.5, torque_saturation=0.6)
    careful = replace(LSR1, limits=limits)
    poses = random_poses(8, 40, 2.0)
    found = sweep_path(careful, fractal(8, roughness=0.1), poses, SERVO)
    drives = found.speed_share > 0.0
    loaded = found.wheel_loads[drives] > 0.0
    assert drives.sum() >= 20
    assert (found.friction_utilisation[drives][loaded] <= 0.5 + 1e-6).all()
    assert (found.torque_saturation[drives] <= 0.6 + 1e-9).all()


def test_energy_and_time_count_the_speed_that_is_made():
    x = np.linspace(-0.3, 0.3, 13)
    path = np.column_stack([x, 0.0 * x, 0.0 * x])
    servo = sweep_path(LSR1, plane(0.3, 0.0), path, SERVO)
    equal = sweep_path(LSR1, plane(0.3, 0.0), path)
    assert servo.time[-1] == pytest.approx(equal.time[-1] / servo.speed_share[0], rel=1e-3)
    # On Coulomb ground without loss, the work is that of the weight; slip adds a little.
    work = LSR1.weight * 0.3 * 0.6
    assert work <= servo.energy[-1] <= 1.06 * work


@pytest.mark.parametrize("droop", [-0.1, 1.0, 1.5, np.nan])
def test_a_droop_that_no_servo_has_is_refused(droop):
    with pytest.raises(ModelError, match="servo_droop"):
        sweep_path(with_droop(LSR1, droop), plane(0.0, 0.0), POSE, SERVO)


def test_m2020_drives_on_servos_too():
    found = sweep_path(M2020, plane(0.2, 0.0, half=4.0), POSE, SERVO)
    assert found.tangential.sum() == pytest.approx(M2020.weight * np.sin(np.arctan(0.2)), rel=1e-5)


def test_scores_of_maps_refuse_where_no_speed_balances():
    steep, easy = plane(0.45, 0.0), plane(0.2, 0.0)
    options = replace(SERVO, friction=0.42)
    assert score_poses(LSR1, easy, POSE, options).within_limits(LSR1)[0]
    assert not score_poses(LSR1, steep, POSE, options).within_limits(LSR1)[0]
    assert np.isinf(score_poses(LSR1, steep, POSE, options).friction_utilisation[0])
