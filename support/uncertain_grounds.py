# SPDX-License-Identifier: Apache-2.0
"""Maps with random errors, and how often predictions on them leave their bounds."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter

from rover_physics import Rover, SweepOptions, Terrain, judge_path
from rover_physics.bounds.path import bound_path
from rover_physics.results.path_prediction import BOUNDED_VALUES
from support.rough_grounds import RESOLUTION, fractal, plane, rocky

ROUNDING = 1e-6
"""Tolerance of the bounds for rounding errors, in the unit of each value."""


def step(height: float) -> Terrain:
    """Return level ground with a step up of `height` [m] at x = 0.3."""
    flat = plane(0.0, 0.0, half=3.0)
    x = flat.origin[0] + RESOLUTION * np.arange(flat.elevation.shape[1])
    return replace(flat, elevation=flat.elevation + height * (x > 0.3))


def uncertain_grounds(rover: Rover) -> dict[str, Terrain]:
    """Return the grounds without errors, by name."""
    return {
        "level": plane(0.0, 0.0, half=3.0),
        "slope": plane(0.25, 0.1, half=3.0),
        "rocks": rocky(3),
        "relief": fractal(2),
        "step": step(0.5 * rover.wheel.radius),
    }


def with_std(terrain: Terrain, std: float) -> Terrain:
    """Return the terrain with the same standard deviation [m] everywhere."""
    return replace(terrain, elevation_std=np.full(terrain.elevation.shape, std))


def path_across(seed: int, count: int = 24) -> np.ndarray:
    """Return a straight path (count, 3), 2 m long, through the middle of a ground."""
    rng = np.random.default_rng(seed)
    heading, aside = rng.uniform(-0.5, 0.5), rng.uniform(-0.6, 0.6)
    along = np.linspace(-1.0, 1.0, count)
    x, y = along * np.cos(heading), aside + along * np.sin(heading)
    return np.column_stack([x, y, np.full(count, heading)])


def arc_across(seed: int, size: float, count: int = 24) -> np.ndarray:
    """Return an arc (count, 3) near the middle of a ground, of radius 0.5 or 1 m times `size`."""
    rng = np.random.default_rng(seed)
    radius, heading = rng.choice([-0.5, -1.0, 0.5, 1.0]) * size, rng.uniform(-np.pi, np.pi)
    turn = np.linspace(0.0, 0.8 * size, count) / radius
    x, y = radius * np.sin(turn), radius * (1.0 - np.cos(turn))
    c, s = np.cos(heading), np.sin(heading)
    start = rng.uniform(-0.3, 0.3, 2) * size
    return np.column_stack([start[0] + c * x - s * y, start[1] + s * x + c * y, heading + turn])


def draw_maps(terrain: Terrain, length: float, count: int, seed: int) -> Iterator[Terrain]:
    """Yield maps with random height errors of the given standard deviations.

    Args:
        terrain: The map, with a layer `elevation_std`.
        length: Correlation length [m], at which the correlation is 1/e; 0: independent errors.
        count: Number of maps.
        seed: Seed of the random numbers.
    """
    rng = np.random.default_rng(seed)
    shape, width = terrain.elevation.shape, length / terrain.resolution / 2.0
    impulse = np.zeros(shape)
    impulse[shape[0] // 2, shape[1] // 2] = 1.0
    scale = 1.0 / np.sqrt((_smooth(impulse, width) ** 2).sum())
    for _ in range(count):
        error = scale * _smooth(rng.standard_normal(shape), width)
        yield replace(terrain, elevation=terrain.elevation + terrain.elevation_std * error)


def _smooth(values: np.ndarray, width: float) -> np.ndarray:
    return gaussian_filter(values, width, mode="wrap") if width > 0.0 else values


@dataclass(frozen=True)
class Outcome:
    """Result of a path on random maps."""

    waypoints: int
    """Number of waypoints with bounds, counted for each map."""
    outside: int
    """Number of these that did not settle, or have a value outside its bounds."""
    unbounded: int
    """Number of waypoints that settle but have no bounds."""
    widths: dict[str, float]
    """Median ratio of the width of the bounds to the range of the random values, by value."""


def draw_path(
    rover: Rover,
    terrain: Terrain,
    poses: np.ndarray,
    length: float,
    count: int,
    seed: int,
    policy: str = "equal",
    sigmas: float = 3.0,
) -> Outcome:
    """Predict a path on random maps and compare the values with their bounds."""
    prediction = judge_path(rover, terrain, poses, SweepOptions(policy=policy))[0]
    bounds = bound_path(rover, terrain, prediction, SweepOptions(policy=policy), sigmas=sigmas)
    rows = bounds.bounded
    limits = {name: getattr(bounds, name)[rows] for name in BOUNDED_VALUES}
    drawn: dict[str, list[np.ndarray]] = {name: [] for name in BOUNDED_VALUES}
    outside = 0
    for sample in draw_maps(terrain, length, count, seed):
        swept = judge_path(rover, sample, poses, SweepOptions(policy=policy))[0]
        beyond = ~swept.settled[rows]
        for name, limit in limits.items():
            value = getattr(swept, name)[rows]
            left = (value < limit[..., 0] - ROUNDING) | (value > limit[..., 1] + ROUNDING)
            beyond |= left.reshape(len(left), -1).any(axis=1)
            drawn[name].append(value)
        outside += int(beyond.sum())
    return Outcome(
        waypoints=int(rows.sum()) * count,
        outside=outside,
        unbounded=int((prediction.settled & ~rows).sum()),
        widths={name: _relative_width(limits[name], drawn[name]) for name in BOUNDED_VALUES},
    )


def _relative_width(limits: np.ndarray, drawn: list[np.ndarray]) -> float:
    """Return the median of width over range, where both are finite and the range is not zero."""
    values = np.array(drawn)
    with np.errstate(invalid="ignore"):
        spread = np.nanmax(values, axis=0) - np.nanmin(values, axis=0)
        width = limits[..., 1] - limits[..., 0]
        known = np.isfinite(width) & np.isfinite(spread) & (spread > 0.0)
    return float(np.median(width[known] / spread[known])) if known.any() else float("nan")
