# SPDX-License-Identifier: Apache-2.0
"""Verdicts of random rough paths with more friction or torque, in pieces, shifted, refined."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated

import numpy as np
import typer

from rover_physics import Rover, SweepOptions, Terrain, Verdict, judge_path, load_rover
from rover_physics.names import EQUAL
from support.rough_grounds import bouldered, fractal, rocky

GROUNDS = (bouldered, rocky, fractal)
FRICTIONS = (0.3, 0.45, 0.6, 0.8, 1.0)
"""Friction coefficients, from the least on."""
TORQUES = (0.3, 0.6, 1.0, 2.0)
"""Largest torques over that of the rover file, from the least on."""
SHIFT = np.array([1234.56, -789.01, 0.0])
"""Shift of map and path: x, y [m], and no turn."""


def random_course(rover: Rover, seed: int) -> tuple[Terrain, np.ndarray]:
    """Return a rough ground in the rover's size, and a straight path over it in any direction."""
    rng = np.random.default_rng(seed)
    ground = GROUNDS[seed % len(GROUNDS)](seed)
    size = rover.wheel.radius / 0.1
    terrain = Terrain(
        ground.elevation * size, ground.resolution * size, tuple(np.multiply(ground.origin, size))
    )
    yaw, along = rng.uniform(-np.pi, np.pi), np.arange(-0.5, 0.5, 0.02) * size
    x, y = rng.uniform(-0.4, 0.4, 2) * size
    return terrain, np.column_stack(
        [x + along * np.cos(yaw), y + along * np.sin(yaw), 0 * along + yaw]
    )


def ask(rover: Rover, terrain: Terrain, path: np.ndarray, options: SweepOptions) -> Verdict:
    """Return the verdict of a path."""
    return judge_path(rover, terrain, path, options)[1]


def changes_of(rover: Rover, seed: int, policy: str = EQUAL) -> Iterator[str]:
    """Yield the names of the changes that a course did not stand, and "passes" if it passes."""
    terrain, path = random_course(rover, seed)
    friction = FRICTIONS[seed % len(FRICTIONS)]
    options = SweepOptions(policy=policy, friction=friction)
    verdict = ask(rover, terrain, path, options)
    if verdict.traversable:
        yield "passes"
    torques = [share * rover.wheel.max_torque for share in TORQUES]
    for name, option, values in (
        ("friction", "friction", FRICTIONS),
        ("torque", "max_torque", torques),
    ):
        asked = [replace(options, **{option: value}) for value in values]
        passes = [ask(rover, terrain, path, one).traversable for one in asked]
        if passes != sorted(passes):
            yield f"more {name} makes it worse"
    if not all(_agrees_in_halves(rover, terrain, path, options, verdict)):
        yield "splitting changes it"
    place = (terrain.origin[0] + SHIFT[0], terrain.origin[1] + SHIFT[1])
    shifted = ask(rover, replace(terrain, origin=place), path + SHIFT, options)
    if shifted.traversable != verdict.traversable:
        yield "shifting changes it"
    middles = 0.5 * (path[1:] + path[:-1])
    fine = np.insert(path, np.arange(1, len(path)), middles, axis=0)
    if ask(rover, terrain, fine, options).traversable != verdict.traversable:
        yield "refining changes it"


def _agrees_in_halves(
    rover: Rover, terrain: Terrain, path: np.ndarray, options: SweepOptions, verdict: Verdict
) -> Iterator[bool]:
    """Yield whether the two halves agree with the whole, split at waypoints that pass.

    "trapped" is not compared: it says that there is no way on from the end of a path, and the end
    of a half is another place, from which the other half may be the way on.
    """
    prediction, judged = judge_path(rover, terrain, path, options)
    passing = np.array([not reason for reason in judged.reasons])
    passing &= ~prediction.falling.any(axis=1)
    for row in (len(path) // 3, len(path) // 2, 2 * len(path) // 3):
        if not passing[row]:
            continue
        parts = [ask(rover, terrain, part, options) for part in (path[: row + 1], path[row:])]
        if "trapped" in {verdict.code, *(part.code for part in parts)}:
            continue
        yield all(part.traversable for part in parts) == verdict.traversable


def main(
    count: Annotated[int, typer.Option(help="Courses for each rover.")] = 1000,
    seed: Annotated[int, typer.Option(help="First seed.")] = 0,
    policy: Annotated[str, typer.Option(help="Torque policy.")] = EQUAL,
) -> None:
    """Print how many courses did not stand each change, and which."""
    for name in ("lsr1", "m2020"):
        found: dict[str, list[int]] = {"passes": []}
        for course in range(seed, seed + count):
            for change in changes_of(load_rover(name), course, policy):
                found.setdefault(change, []).append(course)
        print(f"{name}, {policy}: {count} courses, {len(found.pop('passes'))} pass")
        for change, seeds in found.items():
            print(f"  {change}: {len(seeds)}, seeds {', '.join(map(str, seeds))}")


if __name__ == "__main__":
    typer.run(main)
