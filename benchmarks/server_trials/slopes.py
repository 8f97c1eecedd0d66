"""Long questions on maps of real ground, with a tolerance of the goal as in README."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage

from benchmarks.server_trials.stage import ROOT, Client, Pose, Stage, finish
from rover_physics.terrain.grid import Terrain, load_terrain
from support.waiting import wait_until

TOLERANCE = 0.1
MARS_YARD, BOULDERS = "erc_marsyard2021_9cm", "otira_tls_boulders_3cm"


@dataclass(frozen=True)
class Answer:
    """The answer to one question."""

    time: float
    """Response time [s]."""
    code: str
    """Code of the verdict; empty if traversable."""
    goals: int
    """Number of other goals that were tried."""


def load_real(name: str) -> Terrain:
    """Return a map of the folder ROVER_TERRAIN_DIR, default ../shared/terrain.

    Raises:
        FileNotFoundError: It is not there; it is not part of the project.
    """
    folder = Path(os.environ.get("ROVER_TERRAIN_DIR", ROOT.parent / "shared" / "terrain"))
    if not (folder / f"{name}.npz").is_file():
        raise FileNotFoundError(f"no {folder / name}.npz; set ROVER_TERRAIN_DIR to its folder")
    return load_terrain(folder / f"{name}.npz")


def refine(terrain: Terrain, factor: int) -> Terrain:
    """Return the same ground with cells smaller by a factor, interpolated linearly."""
    fine = ndimage.zoom(terrain.elevation, factor, order=1, grid_mode=False)
    return Terrain(fine, terrain.resolution / factor, terrain.origin)


def draw_questions(terrain: Terrain, count: int, length: float) -> list[tuple[Pose, Pose]]:
    """Return starts and goals on known ground, `length` [m] apart, drawn at random (seed 1)."""
    rng, questions = np.random.default_rng(1), []
    inside = ndimage.binary_erosion(np.isfinite(terrain.elevation), iterations=2)
    rows, columns = np.nonzero(inside)
    while len(questions) < count:
        k, yaw = rng.integers(rows.size), rng.uniform(-np.pi, np.pi)
        start = np.array([columns[k], rows[k]]) * terrain.resolution + terrain.origin
        goal = start + length * np.array([np.cos(yaw), np.sin(yaw)])
        column, row = np.rint((goal - terrain.origin) / terrain.resolution).astype(int)
        within = 0 <= row < inside.shape[0] and 0 <= column < inside.shape[1]
        if within and inside[row, column]:
            questions.append(tuple((float(x), float(y), float(yaw)) for x, y in (start, goal)))
    return questions


def time_questions(
    stage: Stage, terrain: Terrain, length: float, count: int, **parameters: object
) -> list[Answer]:
    """Start a server on a map and time questions of a length [m]."""
    stage.start_ready(terrain, **parameters)
    client = stage.client("asker")
    client.hear_verdicts()
    return [_time(client, *poses) for poses in draw_questions(terrain, count, length)]


def _time(client: Client, start: Pose, goal: Pose) -> Answer:
    began = time.perf_counter()
    plan = finish(client.begin_plan(start, goal, TOLERANCE), 120.0).plan
    taken = time.perf_counter() - began

    def find() -> dict[str, str] | None:
        for message in client.verdicts:
            if message.header.stamp == plan.header.stamp:
                return {entry.key: entry.value for entry in message.status[0].values}
        return None

    verdict = wait_until(find, "the verdict")
    return Answer(taken, verdict["code"], int(verdict.get("alternative_goals_tried", 0)))
