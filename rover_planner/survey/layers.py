# SPDX-License-Identifier: Apache-2.0
"""The layers of a survey: names, types, meanings and colours."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.prediction.map_sweep import SCORES
from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES
from rover_physics.traversability.pose_classes import IMPASSABLE
from rover_physics.traversability.verdict import WORSE, codes_of_verdicts
from rover_planner.survey.layout import Index

NOT_SURVEYED = 255
"""Class and limit of a cell that is not surveyed yet, or whose chunk failed."""
NO_LIMIT = 0
"""Value of `first_limit` where no limit fails; 1 + k stands for code k of verdicts."""
SOME_HEADINGS = len(TRAVERSABILITY_CLASSES)
"""Drawn as a class of its own: impassable at some headings, not at others."""
CLASS_LABELS = (*TRAVERSABILITY_CLASSES, "passable at some headings")
"""Names of the drawn classes, by number."""
CLASS_COLOURS = ("#009E73", "#56B4E9", "#E69F00", "#D55E00", "#F0E442")
"""The palette of Okabe and Ito (2008), by number."""
UNKNOWN_LABEL = "unknown ground, edge, or not surveyed"
"""Name of what has no class."""
MAX_DRAWN = 1200
"""Most cells along a side that are drawn; of more, every second, third, ..."""

QUANTITIES = tuple(name for name in SCORES if name in WORSE)
"""Numbers in a score of `map_sweep` whose worst and best value over the headings are kept."""


def number_limits() -> dict[str, int]:
    """Return the number of each code of a verdict, as kept."""
    return {"": NO_LIMIT} | {code: 1 + k for k, code in enumerate(codes_of_verdicts())}


def count_skipped(shape: Index) -> int:
    """Return of how many cells along a side of a grid one is drawn."""
    return max(1, -(-max(shape) // MAX_DRAWN))


def read_drawn_classes(store: Any) -> NDArray:
    """Return the numbers of the worst classes of the drawn cells of a survey.

    SOME_HEADINGS where the heading decides, NOT_SURVEYED also where the ground is unknown.
    """
    every = count_skipped(store.notes.layout.shape)
    worst, best, first = (
        np.asarray(store.layer(name)[::every, ::every])
        for name in ("worst_class", "best_class", "first_limit")
    )
    limits = number_limits()
    shown = worst.copy()
    shown[(worst == IMPASSABLE) & (best < IMPASSABLE)] = SOME_HEADINGS
    off_ground = [limits[code] for code in ("off_map", "unknown_ground")]
    shown[(best == IMPASSABLE) & np.isin(first, off_ground)] = NOT_SURVEYED
    return shown


def bits_type(headings: int) -> np.dtype:
    """Return the smallest unsigned type with a bit for each heading."""
    least = np.min_scalar_type((1 << headings) - 1)
    return np.dtype(least.name)  # Zarr knows one of NumPy's two types of 8 bytes


def list_layers(headings: int, turns: bool, chance: bool) -> dict[str, np.number]:
    """Return the layers of a survey, each with its value in cells that are not surveyed.

    The value has the type of the layer.

    Args:
        headings: Number of headings.
        turns: Whether turns on the spot are judged.
        chance: Whether chances of failure are found.
    """
    layers: dict[str, np.number] = {}
    for name in ("worst_class", "best_class", "first_limit"):
        layers[name] = np.uint8(NOT_SURVEYED)
    for name in ("passable_headings", *(("turnable_headings",) if turns else ())):
        layers[name] = bits_type(headings).type(0)
    for name in (*QUANTITIES, *(("failure_chance",) if chance else ())):
        for which in ("worst", "best"):
            layers[f"{which}_{name}"] = np.float32(np.nan)
    return layers


def pack_bits(passes: NDArray[np.bool_]) -> NDArray:
    """Return flags (..., headings) as whole numbers (...), heading k in bit k."""
    headings = passes.shape[-1]
    kind = bits_type(headings)
    return np.asarray(passes @ (kind.type(1) << np.arange(headings, dtype=kind)))


def unpack_bits(bits: NDArray, headings: int) -> NDArray[np.bool_]:
    """Return the flags (..., headings) of whole numbers (...)."""
    places = np.arange(headings).astype(bits.dtype)
    return np.asarray((bits[..., None] >> places) & 1, dtype=bool)
