# SPDX-License-Identifier: Apache-2.0
"""Policy "servo" on firm ground and on soil: nine equations hold, and rovers do as they must."""

from dataclasses import replace

import numpy as np
import pytest
import scipy
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from rover_physics import SweepOptions, judge_path, judge_poses
from rover_physics.forces import soil as soil_model
from rover_physics.forces.servo_balance import write_residual
from rover_physics.forces.servo_motion import SERVO_STATE
from rover_physics.forces.servo_wheel import S, T, roll_wheel
from rover_physics.numerics.records import new_record
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.status import Stall
from rover_physics.traversability.torque_ranges import evaluate_in_turn
from support.grounds import fractal, plane, random_poses, rocky, smooth
from support.paths import poses_at
from support.reference_drives import drive_ground, drive_path
from support.rover_geometry import balance_residuals
from support.rovers import FIXED, LSR1, M2020

SERVO = SweepOptions(policy="servo")
SOFT = ("lunar_nominal", "mars_simulant", "dry_sand", "lete_sand")
SAND = replace(SERVO, soil="lete_sand", max_torque=20.0)
POSE = np.zeros((1, 3))
soils = st.sampled_from(SOFT)


def servos_at(rover, ground, poses, options, curvature):
    """Yield the SERVO at each pose that settles and drives."""
    model = pack_model(rover, ground, options)
    motions = motions_of(model, poses, np.full(len(poses), curvature))
    for results, work in evaluate_in_turn(model, poses, motions):
        if results["status"][0] == 0 and results["speed_share"][0] > 0.0:
            yield work.servo


@pytest.mark.parametrize(("rover", "curvature"), [(LSR1, 0.0), (LSR1, 0.8), (FIXED, np.inf)])
@pytest.mark.parametrize(
    ("ground", "half", "options", "least"),
    [(rocky(1), 2.0, SERVO, 25), (smooth(2), 0.6, SAND, 10)],
    ids=["firm", "soil"],
)
def test_the_nine_equations_hold(rover, curvature, ground, half, options, least):
    poses = random_poses(1, 40, half)
    servos = servos_at(rover, ground, poses, options, curvature)
    sizes = [np.linalg.norm(servo.residual) for servo in servos]
    assert len(sizes) >= least
    assert max(sizes) <= 2e-7


def test_a_wheel_on_its_rim_has_friction_about_the_normal_of_the_ground():
    model = pack_model(LSR1, drive_ground("slope", 25.0), SERVO)
    poses, leaning = random_poses(1, 40, 1.0), 0
    for results, work in evaluate_in_turn(model, poses, motions_of(model, poses, np.zeros(40))):
        result, contacts, placement = results[0], work.contacts, work.placement
        leans = abs(work.balance.lean) > 0.02  # else other circles share the load
        for wheel in np.flatnonzero(leans & (result["speed_share"] > 0.0)):
            c, s = contacts.cosine[wheel], contacts.sine[wheel]
            radius = c * placement.up[wheel] - s * placement.forward[wheel]
            forward = s * placement.up[wheel] + c * placement.forward[wheel]
            force = result["wheel_loads"][wheel] * radius
            force = force + result["tangential"][wheel] * forward
            force = force + result["lateral"][wheel] * placement.axis[wheel]
            normal = np.append(-contacts.slope[wheel], 1.0)
            load = force @ normal / np.linalg.norm(normal)
            used = np.sqrt(force @ force - load**2) / (result["friction"][wheel] * load)
            assert used == pytest.approx(result["friction_utilisation"][wheel], abs=0.01)
            leaning += 1
    assert leaning >= 20


def test_without_turning_the_forces_balance_by_an_independent_model():
    narrow = replace(LSR1, wheel=replace(LSR1.wheel, width=1e-3))  # no scrub
    prediction = judge_path(narrow, fractal(3), poses_at(np.linspace(-1.5, 1.5, 30)), SERVO)[0]
    assert prediction.settled.all() and (prediction.speed_share > 0.5).all()
    for i in range(30):
        residuals = balance_residuals(narrow, prediction, i)
        assert max(np.abs(r).max() for r in residuals) <= 1e-2 * narrow.weight / 6.0


@pytest.mark.long  # compiles a kernel of its own; a wrong one leaves the equations unsolved
@pytest.mark.parametrize(
    ("ground", "half", "options", "apart"),
    [(rocky(2), 2.0, SERVO, 1e-3), (smooth(2), 0.6, SAND, 5e-3)],
    ids=["firm", "soil"],
)
def test_the_jacobian_is_that_of_finite_differences(ground, half, options, apart):
    for servo in servos_at(FIXED, ground, random_poses(2, 12, half), options, 0.7):
        z = servo.z * (1.0 + 0.03 * np.sin(np.arange(9))) + 0.01
        write_residual(servo, z)
        J, found = servo.J.copy(), np.empty((9, 9))
        for k in range(9):
            ends = []
            for sign in (1.0, -1.0):
                write_residual(servo, z + sign * 1e-7 * np.eye(9)[k])
                ends.append(servo.residual[:, 0].copy())
            found[:, k] = (ends[0] - ends[1]) / 2e-7
        np.testing.assert_allclose(J, found, atol=apart * np.abs(found).max())


@pytest.mark.parametrize("slope", [0.25, -0.25])
def test_what_is_missing_is_the_weight_along_the_slope_less_what_the_motors_give(slope):
    """Uphill it is missing to drive, downhill to brake."""
    options, ground = replace(SERVO, friction=0.8, max_torque=0.25), plane(slope, 0.0)
    found = judge_poses(LSR1, ground, POSE, [0.0], options)[0]
    motors = 6.0 * 0.25 / (LSR1.wheel.radius * LSR1.weight)
    expected = np.sign(slope) * (np.sin(np.arctan(abs(slope))) - motors)
    assert found.results["deficit"][0] == pytest.approx(expected, rel=1e-3)
    assert found.stalls[0] == (Stall.STALLED if slope > 0.0 else Stall.RUNS_AWAY)


@pytest.mark.parametrize(
    ("slope", "options", "stalls", "code", "reason"),
    [
        (0.45, replace(SERVO, friction=0.4), 0.0, "friction", "no forward speed balances"),
        (0.4, replace(SERVO, soil="dry_sand"), 0.0, "friction", "no forward speed balances"),
        (0.3, replace(SERVO, max_torque=0.2), 1.0, "torque", "motors stall"),
        (0.0, replace(SERVO, soil="dry_sand", max_torque=0.15), 1.0, "torque", "motors stall"),
    ],
)
def test_a_slope_beyond_the_ground_slides_and_one_beyond_the_motors_stalls(
    slope, options, stalls, code, reason
):
    found, verdict = judge_path(LSR1, plane(slope, 0.0), POSE, options)
    assert (found.speed_share[0], found.stalls[0]) == (0.0, stalls)
    assert verdict.code == code and reason in verdict.reason


@pytest.mark.parametrize(("slope", "soil"), [(0.3, None), (0.05, "dry_sand")])
def test_energy_and_time_count_slip_and_droop(slope, soil):
    ground, path = plane(slope, 0.0), poses_at(np.linspace(-0.3, 0.3, 13))
    servo, equal = (
        judge_path(LSR1, ground, path, SweepOptions(policy, soil=soil))[0]
        for policy in ("servo", "equal")
    )
    assert servo.time[-1] == pytest.approx(equal.time[-1] / servo.speed_share[0], rel=1e-3)
    # The rims turn farther than the rover goes: energy is torque times that distance.
    distance = np.hypot(0.6, 0.6 * slope) / (1.0 - servo.slip_ratio[0])
    work = (servo.torque[0] / LSR1.wheel.radius * distance).sum()
    assert servo.energy[-1] == pytest.approx(work, rel=0.02)
    thrust = servo.tangential + servo.motion_resistance
    np.testing.assert_allclose(servo.torque, LSR1.wheel.radius * thrust, rtol=1e-9)
    # The servo's droop gives the rim's speed, and the slip what is left of it.
    rim = 1.0 - LSR1.wheel.servo_droop * servo.torque[0] / LSR1.wheel.max_torque
    assert rim * (1.0 - servo.slip_ratio[0]) == pytest.approx(servo.speed_share[0], abs=0.02)


@settings(max_examples=12)
@given(soils, st.floats(0.02, 0.4))
def test_a_rover_drives_where_its_wheels_can_pull_and_slides_where_they_cannot(soil, slope):
    options = replace(SERVO, soil=soil, max_torque=1e4)
    found = judge_path(M2020, plane(slope, 0.0, half=4.0), POSE, options)[0]
    # Both where it drives and where it does not, loads are close to those of the balance.
    most = (found.friction * found.wheel_loads)[0].sum()
    needed = M2020.weight * np.sin(np.arctan(slope))
    assume(abs(most - needed) > 0.05 * needed)
    assert (found.speed_share[0] > 0.0) == (most > needed)
    assert found.stalls[0] == 0.0


def test_the_resistance_of_soil_that_brakes_a_rover_downhill_is_no_friction_that_it_uses():
    """It was refused, as all friction was used, where no wheel used half of its own."""
    found = judge_path(LSR1, plane(-0.2, 0.0), POSE, replace(SERVO, soil="mars_simulant"))[0]
    used = found.friction_utilisation[0]
    assert found.speed_share[0] > 0.0 and used.max() < 0.5
    assert used.min() <= found.friction_share[0] <= used.max()


@pytest.mark.parametrize("friction", [0.8, 1.5, 2.0])
def test_more_friction_does_not_stop_a_rover_with_strong_motors(friction):
    options = replace(SERVO, friction=friction, max_torque=6.0)
    ground = drive_ground("bump_one_side", 0.0917)
    assert judge_path(LSR1, ground, drive_path(), options)[1].traversable


@pytest.mark.parametrize(("soil", "curvature"), [("lunar_nominal", 0.0), ("lete_sand", np.inf)])
def test_on_rough_soil_servos_drive_wherever_equal_torques_suffice(soil, curvature):
    poses, bends = random_poses(3, 40, 0.8), np.full(40, curvature)
    equal, servo = (
        judge_poses(LSR1, smooth(4), poses, bends, SweepOptions(soil=soil, policy=policy))[0]
        for policy in ("equal", "servo")
    )
    used = np.maximum(equal.friction_utilisation, equal.torque_saturation)
    holds = equal.settled & ((used <= 0.93) & (equal.wheel_loads > 0.0)).all(axis=1)
    assert holds.sum() >= 10 and (servo.speed_share[holds] > 0.0).all()


BAND, FULL = 0.01, 0.2
RADIUS, WIDTH, WEIGHT = 0.1, 0.1, 80.0
SOILS = {name: soil_model.pack_soils((name,))[-1] for name in SOFT}

ways = st.floats(-1.5, 1.5)
velocities = st.tuples(ways, ways, st.floats(-0.05, 0.05))
"""Speeds of a wheel along and across, and of its turn about the contact [nominal speeds]."""
grips = st.floats(1e-3, 0.5)
loads = st.floats(0.01, 0.4)
droops = st.floats(0.0, 0.9)
limits = st.floats(0.02, 0.5)
many = settings(max_examples=20)


def servo_of(limit, droop, share=1.0):
    """Return the SERVO of one wheel that is commanded to roll at the nominal speed."""
    servo = new_record(
        SERVO_STATE, droop=droop, full_traction=FULL, max_traction=limit, creep=BAND,
        friction_share=share, radius=RADIUS, width=WIDTH, weight=WEIGHT,
    )  # fmt: skip
    servo.command[0] = 1.0
    return servo


# One wheel on firm ground and on soil: its forces. Their derivatives are in the Jacobian above


def expected(grip, velocity, droop, limit) -> np.ndarray:
    """Return T, S, D by bisection."""
    along, across, spin = velocity
    wide = np.hypot(across, BAND)

    def forces(slip):
        ends = np.array([slip + spin, slip - spin])
        size = np.hypot(ends, wide)
        pulls = -0.5 * grip * ends / size
        return np.array([pulls.sum(), -0.5 * grip * across * (1 / size).sum(), -np.diff(pulls)[0]])

    def excess(slip):
        return slip - (along - 1.0) - droop / FULL * forces(slip)[T]

    slip = scipy.optimize.brentq(excess, -10.0, 10.0, xtol=1e-15)
    if abs(forces(slip)[T]) > limit:
        most = np.copysign(limit, forces(slip)[T])
        slip = scipy.optimize.brentq(lambda s: forces(s)[T] - most, -1e4, 1e4, xtol=1e-15)
    return forces(slip)


@many
@given(grips, velocities, droops, limits)
def test_forces_are_those_of_servo_and_friction_law(grip, velocity, droop, limit):
    assume(abs(limit - grip) >= 1e-3 * grip)  # all friction along the wheel: slip is unbounded
    servo = servo_of(limit, droop)
    servo.mu[0], servo.pressing[0], servo.slip[0] = 0.5, 2.0 * grip, np.nan
    roll_wheel(servo, 0, velocity)
    force = servo.force[0]
    np.testing.assert_allclose(force, expected(grip, velocity, droop, limit), atol=1e-7)
    assert np.hypot(force[T], force[S]) <= grip + 1e-9
    assert abs(force[T]) <= limit + 1e-12


def soil_forces(soil, load, velocity, rim) -> tuple[np.ndarray, float]:
    """Return F_x, S, D and R over the weight at the speed of the rim, by the notes on soil."""
    row, N = SOILS[soil], load * WEIGHT
    sinkage = soil_model.find_sinkage(row, RADIUS, WIDTH, N)
    length = soil_model.contact_length(RADIUS, sinkage)
    strength = soil_model.shear_strength(row, WIDTH * length, N) / WEIGHT
    along, across, spin = velocity
    ends = []
    for way in (along + spin, along - spin):
        slide = np.array([rim - way, -across])
        size = np.hypot(*slide)
        slip = min(size / max(abs(rim), 1e-9), 1.0)
        share = soil_model.mobilised_share(slip * length / row[soil_model.SHEAR_MODULUS])
        ends.append(0.5 * strength * share * slide / max(size, 1e-12))
    resistance = (
        soil_model.motion_resistance(row, WIDTH, sinkage) / WEIGHT * np.clip(along / BAND, -1, 1)
    )
    shear = np.array([ends[0][0] + ends[1][0], ends[0][1] + ends[1][1], ends[0][0] - ends[1][0]])
    return shear, resistance


@many
@given(soils, loads, velocities, droops, st.floats(0.5, 1.0))
def test_forces_are_those_of_servo_and_soil(soil, load, velocity, droop, share):
    servo = servo_of(10.0, droop, share)
    servo.yields[0], servo.soil[0] = 1, SOILS[soil]
    servo.pressing[0], servo.slip[0] = load, np.nan
    roll_wheel(servo, 0, velocity)

    def excess(rim):
        shear, resistance = soil_forces(soil, load, velocity, rim)
        thrust = share * (shear[0] - resistance) + resistance
        return rim - 1.0 + droop / FULL * thrust

    rim = scipy.optimize.brentq(excess, -50.0, 50.0, xtol=1e-14)
    assume(abs(rim) > 0.05)  # where the rim stands, a creep keeps the slip regular
    shear, resistance = soil_forces(soil, load, velocity, rim)
    assert velocity[0] - servo.slip[0] == pytest.approx(rim, abs=1e-8)
    forces = share * (shear - [resistance, 0.0, 0.0])
    np.testing.assert_allclose(servo.force[0], forces, atol=1e-7)
