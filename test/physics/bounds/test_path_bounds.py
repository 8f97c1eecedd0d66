# SPDX-License-Identifier: Apache-2.0
"""Bounds on uncertain maps hold the prediction and what maps drawn at random give."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from scipy.special import bdtrik

from rover_physics import Rover, SweepOptions, Terrain, judge_path
from rover_physics.errors import ModelError
from rover_physics.results.path_prediction import BOUNDED_VALUES
from rover_physics.status import BoundStatus
from support.grounds import RESOLUTION, fractal, make_terrain, plane, rocky, with_std
from support.paths import arc_of, poses_at
from support.reference_drives import drive_ground
from support.rovers import LSR1, M2020

ROUNDING = 1e-6
"""Tolerance of the bounds for rounding errors, in the unit of each value."""


GROUNDS = {
    "level": lambda rover: plane(0.0, 0.0, half=3.0),
    "slope": lambda rover: plane(0.25, 0.1, half=3.0),
    "rocks": lambda rover: rocky(3),
    "relief": lambda rover: fractal(2),
    "step": lambda rover: drive_ground("step", 0.5 * rover.wheel.radius),
}
"""Makers of the grounds without errors."""


def path_across(seed: int, count: int = 24) -> np.ndarray:
    """Return a straight path (count, 3), 2 m long, through the middle of a ground."""
    rng = np.random.default_rng(seed)
    heading, aside = rng.uniform(-0.5, 0.5), rng.uniform(-0.6, 0.6)
    along = np.linspace(-1.0, 1.0, count)
    return poses_at(along * np.cos(heading), aside + along * np.sin(heading), heading)


def arc_across(seed: int, size: float, count: int = 24) -> np.ndarray:
    """Return an arc (count, 3) near the middle of a ground, of radius 0.5 or 1 m times `size`."""
    rng = np.random.default_rng(seed)
    radius, heading = rng.choice([-0.5, -1.0, 0.5, 1.0]) * size, rng.uniform(-np.pi, np.pi)
    start = rng.uniform(-0.3, 0.3, 2) * size
    return arc_of(1.0 / radius, np.linspace(0.0, 0.8 * size, count), heading) + poses_at(*start)


def draw_maps(terrain: Terrain, length: float, count: int, seed: int) -> Iterator[Terrain]:
    """Yield maps with random height errors by the layer `elevation_std` of a map.

    Their correlation is 1/e at a length [m]; with 0 the error of each cell is its own.
    """
    rng = np.random.default_rng(seed)
    shape, width = terrain.elevation.shape, length / terrain.resolution / 2.0
    for _ in range(count):
        error = gaussian_filter(rng.standard_normal(shape), width, mode="wrap")
        error *= terrain.elevation_std / error.std()
        yield replace(terrain, elevation=terrain.elevation + error)


SLOPE = plane(0.2, 0.1, half=3.0)
PATH = path_across(4)


def bounds_on(rover, terrain, poses=PATH, **arguments):
    prediction = judge_path(rover, terrain, poses, SweepOptions(**arguments))[0]
    return prediction, prediction.bounds


def draw_path(rover, terrain, poses, length, count, seed, **arguments):
    """Predict a path on random maps and compare the values with their bounds.

    Returns:
        Numbers (3,), over all maps: waypoints with bounds, those of them that did not settle or
        have a value outside, and waypoints that settle but have no bounds.
    """
    prediction, bounds = bounds_on(rover, terrain, poses, **arguments)
    rows, outside = bounds.bounded, 0
    limits = {name: getattr(bounds, name)[rows] for name in BOUNDED_VALUES}
    for sample in draw_maps(terrain, length, count, seed):
        swept = judge_path(rover, sample, poses, SweepOptions(**arguments))[0]
        beyond = ~swept.settled[rows]
        for name, limit in limits.items():
            value = getattr(swept, name)[rows]
            left = (value < limit[..., 0] - ROUNDING) | (value > limit[..., 1] + ROUNDING)
            beyond |= left.reshape(len(left), -1).any(axis=1)
        outside += int(beyond.sum())
    return np.array([rows.sum() * count, outside, (prediction.settled & ~rows).sum()])


@pytest.mark.parametrize(
    ("rover", "ground", "paths", "count"),
    [
        (LSR1, "relief", "straight", 1),
        (LSR1, "rocks", "straight", 1),
        (LSR1, "relief", "arcs", 1),
        *[
            pytest.param(*case, marks=pytest.mark.long)
            for rover, ground in product((LSR1, M2020), GROUNDS)
            for case in ((rover, ground, "straight", 4), (rover, ground, "arcs", 2))
        ],
    ],
)
def test_at_most_one_map_in_a_thousand_leaves_the_bounds(rover, ground, paths, count):
    """Errors of each cell on its own, over a wheel and over the rover."""
    size = rover.wheel.radius / LSR1.wheel.radius
    make = path_across if paths == "straight" else partial(arc_across, size=size)
    cases = [(0.0, 0.005), (rover.wheel.radius, 0.003), (0.0, 0.001), (0.8, 0.005)]
    terrain = GROUNDS[ground](rover)
    waypoints, outside, unbounded = sum(
        draw_path(rover, with_std(terrain, std), make(seed), length, 8, seed, policy=policy)
        for seed, (length, std) in enumerate(cases[:count])
        for policy in ("equal", "optimal")
    )
    if paths == "straight":
        assert waypoints > 375 * count and unbounded <= 0.03 * len(PATH) * 8
    assert waypoints > 150 * count
    assert outside <= np.ceil(bdtrik(0.95, waypoints, 1e-3))


@pytest.mark.parametrize(("rover", "terrain"), [(LSR1, fractal(2)), (M2020, SLOPE)])
def test_certain_heights_have_bounds_of_no_width(rover, terrain):
    prediction, bounds = bounds_on(rover, with_std(terrain, 0.0))
    assert bounds.bounded.all()
    for name in set(BOUNDED_VALUES) - {"friction_utilisation", "torque_saturation"}:
        width = np.ptp(getattr(bounds, name), axis=-1)
        scale = rover.weight if name == "wheel_loads" else 1.0
        assert width.max() < 1e-6 * scale, name
    for name in ("friction_utilisation", "torque_saturation"):
        highest = getattr(bounds, name)[..., 1]
        np.testing.assert_allclose(highest, getattr(prediction, name), atol=1e-6)


def test_a_uniform_shift_of_wheels_gives_the_height_of_geometry():
    """On level ground roll is extreme with one side high and the other low."""
    bounds = bounds_on(LSR1, with_std(plane(0.0, 0.0, half=3.0), 0.002))[1]
    track = 2.0 * LSR1.suspension.wheels["rear"][1]
    np.testing.assert_allclose(bounds.roll[:, 1], np.arcsin(0.012 / track), rtol=0.01)
    np.testing.assert_allclose(bounds.roll[:, 0], -bounds.roll[:, 1], rtol=0.01)
    np.testing.assert_allclose(bounds.tilt[:, 0], 0.0, atol=1e-9)
    assert np.all(bounds.tilt[:, 1] > bounds.roll[:, 1])


@settings(max_examples=10)
@given(
    seed=st.integers(0, 10_000),
    std=st.floats(0.0, 0.02),
    sigmas=st.floats(0.1, 4.0),
    rough=st.booleans(),
    policy=st.sampled_from(["equal", "optimal"]),
)
def test_the_verdict_is_never_less_cautious(seed, std, sigmas, rough, policy):
    ground = rocky(seed % 5) if rough else fractal(seed % 5, roughness=0.1)
    poses = path_across(seed, 10)
    nominal = judge_path(LSR1, ground, poses, SweepOptions(policy=policy))[1]
    uncertain = with_std(ground, std)
    prediction, cautious = judge_path(
        LSR1, uncertain, poses, SweepOptions(policy=policy), sigmas=sigmas
    )
    assert prediction.bounds is not None
    for i, (code, reason) in enumerate(zip(nominal.codes, nominal.reasons, strict=True)):
        if code:
            assert (cautious.codes[i], cautious.reasons[i]) == (code, reason)
    if not nominal.traversable:
        assert not cautious.traversable
        assert cautious.first_failure <= nominal.first_failure
    assert cautious.traversable == (cautious.first_failure < 0) == (not any(cautious.codes))
    assert cautious.map_sigmas == sigmas
    if prediction.bounds.bounded.any():
        assert cautious.tilt_bound >= nominal.max_tilt - 1e-9 or not all(prediction.bounds.bounded)


def limited(**limits) -> Rover:
    return replace(LSR1, limits=replace(LSR1.limits, **limits))


STIFF = replace(LSR1, suspension=replace(LSR1.suspension, bogie_limits=(-0.02, 0.9)))


@pytest.mark.parametrize(
    ("rover", "code"),
    [
        (replace(LSR1, friction=0.3), "friction"),
        (limited(tilt=0.03), "tilt"),
        (limited(belly_clearance=0.22), "belly"),
        (limited(tip_over_ratio=0.97), "tip_over"),
        (limited(torque_saturation=0.05), "torque"),
        (STIFF, "suspension"),
    ],
)
def test_each_limit_is_held_against_its_bound_and_the_refusal_says_so(rover, code):
    ground = plane(0.0, 0.0, half=3.0)
    uncertain = with_std(ground, 0.004)
    assert judge_path(rover, ground, PATH)[1].traversable
    assert judge_path(rover, uncertain, PATH, sigmas=0.2)[1].traversable
    verdict = judge_path(rover, uncertain, PATH)[1]
    assert (verdict.code, set(verdict.codes)) == (code, {code})
    assert verdict.reason.endswith("at worst within 3 sigma of the map")


def test_the_foot_of_a_wall_has_no_bounds_and_says_why():
    """Just before its front wheels climb, noise decides on which level they stand."""
    ground = with_std(drive_ground("step", 1.6 * M2020.wheel.radius), 0.006)
    prediction, verdict = judge_path(
        M2020, ground, poses_at(np.arange(-1.5, -0.3, 0.02), 0.05, 0.03)
    )
    edges = prediction.bounds.status == BoundStatus.ON_EDGE
    assert 0 < edges.sum() < 0.2 * len(edges)
    assert np.all(np.isnan(prediction.bounds.roll[edges]))
    reasons = {verdict.reasons[i] for i in np.flatnonzero(edges) if "edge" in verdict.reasons[i]}
    assert reasons == {"a wheel may climb or fall off an edge within 3 sigma of the map"}


@pytest.mark.parametrize(
    ("last", "status", "code"),
    [(49, BoundStatus.UNKNOWN_NEAR, "unknown_ground"), (60, BoundStatus.OFF_MAP_NEAR, "off_map")],
)
def test_unknown_ground_and_the_end_of_the_map_within_reach_are_told_apart(last, status, code):
    """A wheel that stands just clear of them may be turned over them by errors of 5 cm."""
    edge = RESOLUTION * last - 1.2
    known = make_terrain(lambda x, y: np.where(x > edge + 1e-6, np.nan, 0.0), RESOLUTION, 1.2)
    ground = with_std(known, 0.015)
    poses = np.array([[edge - 0.501, 0.0, 0.0], [edge - 0.7, 0.0, 0.0]])
    prediction, verdict = judge_path(LSR1, ground, poses)
    assert prediction.settled.all()
    assert prediction.bounds.status.tolist() == [status, BoundStatus.BOUNDED]
    assert verdict.codes[0] == code
    assert verdict.reasons[0].endswith("within 3 sigma of the map")


def test_a_map_without_the_layer_or_sigmas_has_no_bounds():
    certain, uncertain = fractal(2), with_std(fractal(2), 0.01)
    assert judge_path(LSR1, certain, PATH)[0].bounds is None
    for sigmas in (None, 0.0):
        prediction, verdict = judge_path(LSR1, uncertain, PATH, sigmas=sigmas)
        assert prediction.bounds is None
        assert verdict.map_sigmas == 0.0
        assert np.isnan(verdict.tilt_bound)
    for sigmas in (-1.0, float("nan"), float("inf")):
        with pytest.raises(ModelError, match=f"sigmas is {sigmas}"):
            judge_path(LSR1, certain, PATH, sigmas=sigmas)


@pytest.mark.parametrize(
    ("ground", "std", "soil", "policy"),
    [
        (fractal(2, roughness=0.03), 0.001, "dry_sand", "equal"),
        (fractal(2, roughness=0.03), 0.001, "dry_sand", "optimal"),
        (rocky(3), 0.0005, "lunar_nominal", "optimal"),  # equal torques load wheels otherwise
    ],
)
def test_soil_and_its_sinkage_are_bounded(ground, std, soil, policy):
    waypoints, outside, _ = draw_path(
        LSR1, with_std(ground, std), PATH, 0.0, 2, 0, soil=soil, policy=policy
    )
    assert waypoints > 40 and outside == 0


def test_ground_beside_a_wheel_counts_where_the_wheel_may_move_sideways():
    """The left wheels stand half a millimetre beside slippery ground."""
    terrain = with_std(plane(0.2, 0.0, half=3.0), 0.003)
    slippery, edge = np.full(terrain.elevation.shape, 0.8), 0.38
    y = terrain.origin[1] + RESOLUTION * np.arange(len(slippery))
    slippery[y > edge] = 0.4
    outside = LSR1.suspension.wheels["rear"][1] + 0.5 * LSR1.wheel.width
    poses = poses_at(np.zeros(1), edge - 0.0005 - outside, 0.0)
    _, bounds = bounds_on(LSR1, replace(terrain, friction=slippery), poses)
    right, left = np.split(bounds.friction_utilisation[0, :, 1], 2)
    np.testing.assert_allclose(left, 2.0 * right, rtol=0.05)
