# SPDX-License-Identifier: Apache-2.0
"""Small maps and surveys for tests of surveys."""

import itertools
import os
import signal
from pathlib import Path

import numpy as np

from rover_physics import SweepOptions, Terrain, save_terrain
from rover_planner.survey.chunk_survey import SurveyJob, survey_chunk
from rover_planner.survey.layout import Index
from rover_planner.survey.request import SurveyRequest
from rover_planner.survey.store import SurveyStore
from rover_planner.survey.survey import PreparedSurvey, prepare_survey
from support.rovers import LSR1

RESOLUTION = 0.1
"""Cell size of the maps [m]."""


def make_rough_map(rows=150, columns=170, origin=(1200.0, -340.0)) -> Terrain:
    """Return waves with rocks, a wall and a hole of unknown ground, far from the origin."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[0:rows, 0:columns] * RESOLUTION
    heights = 0.05 * np.sin(1.3 * x) + 0.04 * np.sin(1.7 * y + 0.4) + 0.1 * np.sin(0.3 * x * y)
    for at_x, at_y in rng.uniform(0.0, columns * RESOLUTION, (40, 2)):
        heights += 0.15 * np.exp(-((x - at_x) ** 2 + (y - at_y) ** 2) / 0.03)
    heights[:, columns // 2 : columns // 2 + 3] += 0.6 * (y[:, :1] < 0.7 * rows * RESOLUTION)
    heights[rows // 3 : rows // 3 + 2, columns // 4 : columns // 4 + 2] = np.nan
    return Terrain(heights, RESOLUTION, origin)


def make_request(**changes) -> SurveyRequest:
    """Return a request of lsr1 at 4 headings with changes; `policy` is that of the options."""
    options = SweepOptions(policy=changes.pop("policy", "equal"))
    return SurveyRequest(**{"rover": LSR1, "options": options, "headings": 4} | changes)


def prepare_here(
    folder: Path, terrain: Terrain, request: SurveyRequest, **changes
) -> PreparedSurvey:
    """Save a terrain and make the store of its survey beside it."""
    folder.mkdir(parents=True, exist_ok=True)
    save_terrain(folder / "map.npz", terrain)
    return prepare_survey(request, str(folder / "map.npz"), folder / "out", **changes)


def compute_here(prepared: PreparedSurvey) -> PreparedSurvey:
    """Survey the chunks that are left in this process, without a cluster."""
    for chunk in prepared.chunks:
        survey_chunk(prepared.job, chunk)
    return prepared


def survey_here(
    folder: Path, terrain: Terrain, request: SurveyRequest, **changes
) -> PreparedSurvey:
    """Survey a terrain in this process, without a cluster; return it with its store."""
    return compute_here(prepare_here(folder, terrain, request, **changes))


def layers_of(store: SurveyStore) -> dict[str, np.ndarray]:
    """Return all layers of a store."""
    return {name: store.layer(name)[:] for name in store.notes.layers}


def assert_same_bits(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> None:
    """Assert that layers are the same to the bit."""
    assert one.keys() == other.keys()
    for name, values in one.items():
        assert values.dtype == other[name].dtype
        assert values.tobytes() == other[name].tobytes(), name


_attempts = itertools.count(1)


def fail_on_one(job: SurveyJob, chunk: Index) -> int | OSError:
    """Survey a chunk as a task does, but fail on one; here, as workers import it."""
    if chunk == (0, 1):
        raise RuntimeError(f"this chunk is cursed after {next(_attempts)} attempts")
    return survey_chunk(job, chunk)


def die_on_one(job: SurveyJob, chunk: Index) -> int | OSError:
    """Survey a chunk as a task does, but die of one."""
    if chunk == (0, 1):
        os.kill(os.getpid(), signal.SIGKILL)
    return survey_chunk(job, chunk)
