# SPDX-License-Identifier: Apache-2.0
"""The numbers of a survey: shares of the surveyed cells by class, and area."""

from typing import Any

import numpy as np

from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES
from rover_planner.survey.layers import CLASS_NUMBERS, NOT_SURVEYED
from rover_planner.survey.store import SurveyStore

BAND = 1024
"""Rows that are read at a time."""


def summarise(store: SurveyStore) -> dict[str, Any]:
    """Return the number of surveyed cells and their shares by best and worst class."""
    counts = {name: np.zeros(256, np.int64) for name in ("best_class", "worst_class")}
    for name, count in counts.items():
        layer = store.layer(name)
        for first in range(0, layer.shape[0], BAND):
            count += np.bincount(layer[first : first + BAND].ravel(), minlength=256)
    cells = int(counts["best_class"].sum())
    surveyed = cells - int(counts["best_class"][NOT_SURVEYED])
    shares = {
        name: {
            which: round(int(count[CLASS_NUMBERS[which]]) / max(surveyed, 1), 6)
            for which in TRAVERSABILITY_CLASSES
        }
        for name, count in counts.items()
    }
    return {"cells": cells, "surveyed": surveyed, **shares}
