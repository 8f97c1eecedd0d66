# SPDX-License-Identifier: Apache-2.0
"""A study as work in the background: progress after each rover, then result and picture."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_planner.studies.runner import StudyResult, count_trials, run_study
from rover_planner.studies.study_file import Study
from rover_planner.studies.study_plot import draw_pixels
from rover_planner.studies.summary import describe_result
from rover_planner.viewer.state.background_work import Progress


@dataclass(frozen=True, eq=False)
class FinishedStudy:
    """What the page shows of a study."""

    result: StudyResult
    """All rovers that were tried."""
    lines: tuple[str, ...]
    """The rover as it is and the best one, in words."""
    picture: NDArray[np.uint8]
    """The picture of the study (height, width, 4), RGBA."""


def run_in_background(study: Study) -> Iterator[Progress | FinishedStudy]:
    """Run a study and yield its result; see `background_work.Work`.

    Raises:
        PlanningError: No rover of the study could be judged.
    """
    yield Progress("trying rover", 1, count_trials(study))
    result = run_study(study)
    yield FinishedStudy(result, tuple(describe_result(result)), draw_pixels(result))
