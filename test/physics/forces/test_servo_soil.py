"""Speed servos on yielding soil: one wheel's forces and their derivatives, and whole rovers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from rover_physics.forces.servo import write_residual
from rover_physics.forces.servo_record import SERVO
from rover_physics.forces.servo_soil import roll_on_soil
from rover_physics.forces.servo_wheel import D, S, T
from rover_physics.forces.soil import (
    SHEAR_MODULUS,
    contact_length,
    find_sinkage,
    mobilised_share,
    motion_resistance,
    pack_soils,
    shear_strength,
    thrust_at_slip,
)
from rover_physics.names import EQUAL
from rover_physics.names import SERVO as SERVO_POLICY
from rover_physics.numerics.records import new_record
from rover_physics.prediction.evaluation import evaluate_pose, new_results, new_works, set_pose
from rover_physics.prediction.packed_model import pack_model
from rover_physics.prediction.path_motion import motions_of
from rover_physics.prediction.sweep import sweep_path, sweep_poses
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.soil_file import load_soils
from rover_physics.traversability.judge import judge_path
from support.rough_grounds import fractal, mirrored, plane, random_poses, smooth

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
FIXED = replace(LSR1, steering=None)
SOFT = ("lunar_nominal", "mars_simulant", "dry_sand", "lete_sand")
CREEP, FULL = 0.01, 0.2
RADIUS, WIDTH, WEIGHT = 0.1, 0.1, 80.0
POSE = np.zeros((1, 3))
SWAP = [3, 4, 5, 0, 1, 2]
soils = st.sampled_from(SOFT)
loads = st.floats(0.01, 0.4)
ways = st.floats(-1.5, 1.5)
spins = st.floats(-0.05, 0.05)
droops = st.floats(0.0, 0.9)
limits = st.floats(0.01, 0.5)
shares = st.floats(0.5, 1.0)
many = settings(max_examples=200, deadline=None)
few = settings(max_examples=25, deadline=None)


def on(soil, **more) -> SweepOptions:
    return SweepOptions(soil=soil, policy=SERVO_POLICY, **more)


def roll(soil, load, velocity, droop=0.3, limit=0.2, share=1.0):
    """Return the SERVO of one wheel that is commanded to roll at the nominal speed."""
    servo = new_record(
        SERVO, droop=droop, full_traction=FULL, max_traction=limit, creep=CREEP,
        friction_share=share, radius=RADIUS, width=WIDTH, weight=WEIGHT,
    )  # fmt: skip
    servo.soil[0], servo.load[0], servo.command[0] = pack_soils((soil,))[-1], load, 1.0
    servo.slip[0] = np.nan
    roll_on_soil(servo, 0, velocity)
    return servo


def soil_forces(soil, load, velocity, rim) -> tuple[np.ndarray, float]:
    """Return F_x, S, D and R over the weight at the speed of the rim, by notes/soil.md."""
    row = pack_soils((soil,))[-1]
    N = load * WEIGHT
    sinkage = find_sinkage(row, RADIUS, WIDTH, N)
    length = contact_length(RADIUS, sinkage)
    strength = shear_strength(row, WIDTH * length, N) / WEIGHT
    along, across, spin = velocity
    ends = []
    for way in (along + spin, along - spin):
        slide = np.array([rim - way, -across])
        size = np.hypot(*slide)
        slip = min(size / max(abs(rim), 1e-9), 1.0)
        share = mobilised_share(slip * length / row[SHEAR_MODULUS])
        ends.append(0.5 * strength * share * slide / max(size, 1e-12))
    resistance = motion_resistance(row, WIDTH, sinkage) / WEIGHT
    resistance *= np.clip(along / CREEP, -1.0, 1.0)
    return np.array([ends[0][0] + ends[1][0], ends[0][1] + ends[1][1], ends[0][0] - ends[1][0]]), (
        resistance
    )


@many
@given(soils, loads, ways, ways, spins, droops, shares)
def test_forces_are_those_of_servo_and_soil(soil, load, along, across, spin, droop, share):
    velocity = along, across, spin
    servo = roll(soil, load, velocity, droop, 10.0, share)

    def excess(rim):
        shear, resistance = soil_forces(soil, load, velocity, rim)
        thrust = share * (shear[0] - resistance) + resistance
        return rim - 1.0 + droop / FULL * thrust

    rim = brentq(excess, -50.0, 50.0, xtol=1e-14)
    assume(abs(rim) > 0.05)  # where the rim stands, a creep keeps the slip regular
    shear, resistance = soil_forces(soil, load, velocity, rim)
    assert along - servo.slip[0] == pytest.approx(rim, abs=1e-8)
    np.testing.assert_allclose(
        servo.force[0],
        [share * (shear[0] - resistance), share * shear[1], share * shear[2]],
        atol=1e-7,
    )


@many
@given(soils, loads, ways, ways, spins, droops, limits)
def test_rates_are_the_differences_of_the_forces(soil, load, along, across, spin, droop, limit):
    at = np.array([along, across, spin, load])
    rates = roll(soil, load, (along, across, spin), droop, limit).force_rate[0].copy()

    def forces(moved):
        return roll(soil, moved[3], tuple(moved[:3]), droop, limit).force[0].copy()

    step = 1e-6
    for k in range(4):
        one, here, two = (forces(at + sign * step * np.eye(4)[k]) for sign in (1.0, 0.0, -1.0))
        left, right = (here - two) / step, (one - here) / step
        assume(np.abs(left - right).max() < 1e-2 * max(1.0, np.abs(left).max()))  # no kink
        scale = max(1.0, np.abs(left).max())
        np.testing.assert_allclose(rates[:, k], 0.5 * (left + right), atol=5e-3 * scale)


@many
@given(soils, loads, ways, ways, spins, limits)
def test_no_force_exceeds_the_strength_of_the_soil_or_the_torque(
    soil, load, along, across, spin, limit
):
    assume(abs(along) > CREEP)
    force = roll(soil, load, (along, across, spin), limit=limit).force[0]
    row = pack_soils((soil,))[-1]
    resistance = motion_resistance(row, WIDTH, find_sinkage(row, RADIUS, WIDTH, load * WEIGHT))
    thrust = force[T] + np.sign(along) * resistance / WEIGHT
    largest = thrust_at_slip(row, RADIUS, WIDTH, load * WEIGHT, 1.0) / WEIGHT
    assert np.hypot(thrust, force[S]) <= largest * (1.0 + 1e-9)
    assert abs(thrust) <= limit + 1e-9


def test_a_turning_wheel_scrubs_against_the_turn_on_soil():
    turning = roll("dry_sand", 0.17, (0.8, 0.0, 0.02)).force[0]
    assert turning[D] < 0.0 < roll("dry_sand", 0.17, (0.8, 0.0, -0.02)).force[0, D]


def servos_at(rover, ground, poses, options, curvature):
    """Yield the SERVO at each pose that settles and drives."""
    model = pack_model(rover, ground, options)
    motions = motions_of(model, poses, np.full(len(poses), curvature))
    work, result = new_works(1, 1)[0], new_results(1)[0]
    for i in range(len(poses)):
        set_pose(model.record, poses, motions, i, work)
        evaluate_pose(model.record, work, result)
        if result.status == 0 and result.speed_share > 0.0:
            yield work.servo


@pytest.mark.parametrize("rover", [LSR1, FIXED], ids=["steered", "fixed"])
@pytest.mark.parametrize("curvature", [0.0, 0.8, np.inf])
def test_the_nine_equations_hold_on_soil(rover, curvature):
    poses = random_poses(1, 30, 0.6)
    servos = servos_at(rover, smooth(2), poses, on("lete_sand", max_torque=20.0), curvature)
    sizes = [write_residual(servo, servo.z) for servo in servos]
    assert len(sizes) >= (15 if np.isfinite(curvature) else 8)
    assert max(sizes) <= 2e-7


def evenly_loaded():
    """Return lsr1 with the centre of mass where all wheels carry alike on level ground."""

    def moved(way):
        body = LSR1.masses.body
        com = (body.com[0] + way, *body.com[1:])
        return replace(LSR1, masses=replace(LSR1.masses, body=replace(body, com=com)))

    def excess(way):
        loads = sweep_path(moved(way), plane(0.0, 0.0), POSE).wheel_loads[0]
        return loads[0] - loads[1]

    return moved(brentq(excess, -0.1, 0.1, xtol=1e-12))


@pytest.mark.parametrize("soil", SOFT)
@pytest.mark.parametrize("backward", [False, True])
def test_where_all_wheels_carry_alike_servos_are_equal_torques(soil, backward):
    rover, ground = evenly_loaded(), plane(0.0, 0.0)
    servo = sweep_path(rover, ground, POSE, on(soil, backward=backward))
    equal = sweep_path(rover, ground, POSE, SweepOptions(soil=soil, backward=backward))
    for name in ("wheel_loads", "torque", "slip_ratio", "sinkage", "motion_resistance"):
        np.testing.assert_allclose(
            getattr(servo, name), getattr(equal, name), rtol=1e-5, err_msg=name
        )
    np.testing.assert_allclose(servo.friction_utilisation, 0.0, atol=1e-5)


@few
@given(soils, st.floats(-0.15, 0.25), st.floats(-0.1, 0.1))
def test_each_wheel_obeys_soil_servo_and_speed(soil, slope, cross):
    found = sweep_path(LSR1, plane(slope, cross), POSE, on(soil))
    assume(found.speed_share[0] > 0.0)
    N, i = found.wheel_loads[0], found.slip_ratio[0]
    row = pack_soils((soil,))[-1]
    thrust = found.tangential[0] + found.motion_resistance[0]
    np.testing.assert_allclose(found.torque[0], LSR1.wheel.radius * thrust, rtol=1e-9)
    # The servo's droop gives the rim's speed, and the slip what is left of it.
    rim = 1.0 - LSR1.wheel.servo_droop * found.torque[0] / LSR1.wheel.max_torque
    speed = rim * (1.0 - i)
    assert speed == pytest.approx(found.speed_share[0], abs=0.02)
    if cross == 0.0:
        radius, width = LSR1.wheel.radius, LSR1.wheel.width
        shear = [thrust_at_slip(row, radius, width, n, j) for n, j in zip(N, i, strict=True)]
        np.testing.assert_allclose(thrust, shear, atol=1e-4 * LSR1.weight)
    assert found.tangential[0].sum() == pytest.approx(
        LSR1.weight * slope / np.sqrt(1.0 + slope**2 + cross**2), abs=0.02 * LSR1.weight
    )


@few
@given(soils, st.floats(0.0, 0.35))
def test_a_small_change_of_slope_changes_little(soil, slope):
    ends = [sweep_path(LSR1, plane(slope + step, 0.0), POSE, on(soil)) for step in (0.0, 1e-5)]
    assume(all(found.speed_share[0] > 0.0 for found in ends))
    for name, scale in (("speed_share", 1.0), ("wheel_loads", LSR1.weight), ("torque", 2.0)):
        one, two = (getattr(found, name) for found in ends)
        np.testing.assert_allclose(one, two, atol=2e-3 * scale, err_msg=name)


@few
@given(soils, st.floats(0.02, 0.4))
def test_a_rover_drives_where_its_wheels_can_pull_and_slides_where_they_cannot(soil, slope):
    found = sweep_path(M2020, plane(slope, 0.0, half=4.0), POSE, on(soil, max_torque=1e4))
    # Both where it drives and where it does not, loads are close to those of the balance.
    most = (found.friction * found.wheel_loads)[0].sum()
    needed = M2020.weight * np.sin(np.arctan(slope))
    assume(abs(most - needed) > 0.05 * needed)
    assert (found.speed_share[0] > 0.0) == (most > needed)
    assert found.stalls[0] == 0.0


def test_motors_that_cannot_turn_the_wheels_in_soft_soil_stall():
    weak = sweep_path(LSR1, plane(0.0, 0.0), POSE, on("dry_sand", max_torque=0.15))
    assert (weak.speed_share[0], weak.stalls[0]) == (0.0, 1.0)
    verdict = judge_path(LSR1, plane(0.0, 0.0), POSE, on("dry_sand", max_torque=0.15))[1]
    assert verdict.code == "torque" and "motors stall" in verdict.reason
    steep = judge_path(LSR1, plane(0.4, 0.0), POSE, on("dry_sand"))[1]
    assert steep.code == "friction" and "no forward speed balances" in steep.reason


def test_hard_soil_comes_to_coulomb_friction(monkeypatch):
    soft = load_soils()["lete_sand"]
    coulomb = sweep_poses(
        LSR1, fractal(8, roughness=0.05), random_poses(8, 30, 2.0), np.zeros(30),
        SweepOptions(policy=SERVO_POLICY, friction=0.7),
    )  # fmt: skip
    apart = []
    for hardness in (1e2, 1e4, 1e6):
        hard = replace(
            soft, cohesion=1e-3, friction_angle=np.arctan(0.7), k_c=soft.k_c * hardness,
            k_phi=soft.k_phi * hardness, shear_modulus=soft.shear_modulus / hardness,
        )  # fmt: skip
        monkeypatch.setattr("rover_physics.forces.soil.load_soils", lambda hard=hard: {"x": hard})
        found = sweep_poses(
            LSR1, fractal(8, roughness=0.05), random_poses(8, 30, 2.0), np.zeros(30), on("x")
        )
        both = (found.speed_share > 0.0) & (coulomb.speed_share > 0.0)
        assert both.sum() >= 20
        apart.append(
            [
                np.abs(found.torque - coulomb.torque)[both].mean(),
                np.abs(found.speed_share - coulomb.speed_share)[both].mean(),
                found.sinkage[both].max(),
            ]
        )
    assert (np.diff(apart, axis=0) <= 1e-6).all()
    assert apart[-1][0] < 0.02 and apart[-1][1] < 0.005 and apart[-1][2] < 1e-5


@pytest.mark.parametrize("curvature", [0.0, 0.5, np.inf])
def test_mirrored_ground_mirrored_result_on_soil(curvature):
    ground, poses = smooth(5), random_poses(5, 20, 0.6)
    other, flipped = mirrored(ground, poses)
    bends = np.full(20, curvature)
    options = on("lete_sand", max_torque=20.0)
    one = sweep_poses(LSR1, ground, poses, bends, options)
    two = sweep_poses(LSR1, other, flipped, -bends, options)
    both = (one.speed_share > 0.0) & (two.speed_share > 0.0)
    assert both.sum() >= 8
    np.testing.assert_allclose(
        one.wheel_loads[both], two.wheel_loads[both][:, SWAP], atol=1e-3 * LSR1.weight
    )
    np.testing.assert_allclose(one.torque[both], two.torque[both][:, SWAP], atol=2e-2)


def test_a_friction_limit_leaves_a_share_of_the_soil_unused():
    limits = replace(LSR1.limits, friction_utilisation=0.5)
    careful = replace(LSR1, limits=limits)
    poses = random_poses(8, 30, 0.6)
    found = sweep_path(careful, smooth(8), poses, on("dry_sand"))
    drives = found.speed_share > 0.0
    assert drives.sum() >= 10
    assert (found.friction_utilisation[drives] <= 0.5 + 1e-6).all()


def test_firm_patches_of_a_soil_layer_are_driven_as_coulomb_ground():
    level = plane(0.1, 0.0)
    layered = replace(
        level, soil=np.zeros(level.elevation.shape, np.int32), soil_names=("firm_ground",)
    )
    firm = sweep_path(LSR1, layered, POSE, SweepOptions(policy=SERVO_POLICY, friction=0.3))
    plain = sweep_path(LSR1, level, POSE, SweepOptions(policy=SERVO_POLICY, friction=0.8))
    np.testing.assert_array_equal(firm.torque, plain.torque)
    half = np.zeros(level.elevation.shape, np.int32)
    half[: half.shape[0] // 2] = 1
    mixed = replace(layered, soil=half, soil_names=("firm_ground", "lete_sand"))
    found = sweep_path(LSR1, mixed, POSE, SweepOptions(policy=SERVO_POLICY))
    right, left = slice(0, 3), slice(3, 6)
    assert (found.sinkage[0, right] > 0.0).all() and (found.sinkage[0, left] == 0.0).all()
    assert found.tangential[0, left].sum() > found.tangential[0, right].sum()


def test_energy_and_time_on_soil_count_slip_and_droop():
    x = np.linspace(-0.3, 0.3, 13)
    path = np.column_stack([x, 0.0 * x, 0.0 * x])
    servo = sweep_path(LSR1, plane(0.05, 0.0), path, on("dry_sand"))
    equal = sweep_path(LSR1, plane(0.05, 0.0), path, SweepOptions(soil="dry_sand", policy=EQUAL))
    assert servo.time[-1] == pytest.approx(equal.time[-1] / servo.speed_share[0], rel=1e-3)
    # The rims turn farther than the rover goes: energy is torque times that way.
    way = np.hypot(0.6, 0.6 * 0.05) / (1.0 - servo.slip_ratio[0])
    work = (servo.torque[0] / LSR1.wheel.radius * way).sum()
    assert servo.energy[-1] == pytest.approx(work, rel=0.02)


@pytest.mark.parametrize("soil", SOFT)
@pytest.mark.parametrize("curvature", [0.0, 0.7, np.inf])
def test_on_rough_soil_servos_drive_wherever_equal_torques_suffice(soil, curvature):
    found = []
    for rover in (LSR1, M2020):
        for ground in (fractal(3), smooth(4)):
            poses = random_poses(3, 40, 0.8)
            bends = np.full(40, curvature)
            equal = sweep_poses(rover, ground, poses, bends, SweepOptions(soil=soil))
            servo = sweep_poses(rover, ground, poses, bends, on(soil))
            used = np.maximum(equal.friction_utilisation, equal.torque_saturation)
            holds = equal.settled & (used <= 0.93).all(axis=1)
            holds &= (equal.wheel_loads > 0.0).all(axis=1)
            found.append((holds.sum(), (holds & ~(servo.speed_share > 0.0)).sum()))
    held, refused = np.sum(found, axis=0)
    assert held >= 20 and refused == 0
