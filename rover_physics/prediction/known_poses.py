# SPDX-License-Identifier: Apache-2.0
"""Remembers what a model has found at poses, so that it is not asked twice about one.

What the model finds at a pose depends on pose and motion alone, and on the ground near the pose.
A path is made of pieces that were judged before, and after a change of the map most of it is as it
was.
"""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.results.record import RESULT, numbers_of, place_results, unwritten_results

MOST = 20_000
"""Number of poses that are remembered; beyond, the oldest are forgotten. A pose takes 1.6 kB."""
ASKED = np.dtype("V48")
"""The numbers of a pose and of its motion as one value."""

Evaluate = Callable[[Floats, Floats], np.ndarray]
"""Returns RESULTs (n,) of poses (n, 3) with motions (n, 3)."""


class KnownPoses:
    """RESULTs of the last poses that one model was asked about, by pose and motion."""

    def __init__(self, most: int = MOST, others: "KnownPoses | None" = None):
        """Begin with none; `most` is the number of poses that are remembered.

        What is not known, `others` of the same model may know.
        """
        self._others = others
        self._rows: dict[bytes, int] = {}
        self._keys: list[bytes] = [b""] * most
        self._places = np.empty((most, 2))
        self._results = unwritten_results(most)
        self._next = 0

    def complete(self, poses: Floats, motions: Floats, evaluate: Evaluate) -> np.ndarray:
        """Return the RESULTs (n,) of poses (n, 3) with motions (n, 3).

        `evaluate` is asked about those that are not known.
        """
        if self._others is not None:
            evaluate = partial(self._others.complete, evaluate=evaluate)
        keys = np.hstack([poses, motions]).view(ASKED)[:, 0].tolist()
        known = np.array([self._rows.get(key, -1) for key in keys], np.int64)
        new = np.flatnonzero(known < 0)
        if len(new) == len(keys):
            results = evaluate(poses, motions)
        else:
            results = numbers_of(self._results)[known].view(RESULT)[:, 0]
            if len(new):
                place_results(evaluate(poses[new], motions[new]), results, new)
        self._keep([keys[k] for k in new.tolist()], poses[new, :2], results, new)
        return results

    def forget(self, are_near: Callable[[Floats], NDArray[np.bool_]]) -> None:
        """Forget the poses of which `are_near` is True at x, y (n, 2) [m]."""
        rows = np.fromiter(self._rows.values(), np.int64, len(self._rows))
        for row in rows[are_near(self._places[rows])].tolist():
            del self._rows[self._keys[row]]

    def _keep(
        self, keys: list[bytes], places: Floats, results: np.ndarray, rows: NDArray[np.int64]
    ) -> None:
        """Keep the rows (k,) of RESULTs at places (k, 2), where the oldest ones were."""
        most = len(self._keys)
        keys, places, rows = keys[-most:], places[-most:], rows[-most:]
        to = (self._next + np.arange(len(rows))) % most
        for key, row in zip(keys, to.tolist(), strict=True):
            if self._rows.get(self._keys[row]) == row:
                del self._rows[self._keys[row]]
            self._rows[key], self._keys[row] = row, key
        self._places[to], numbers_of(self._results)[to] = places, numbers_of(results)[rows]
        self._next = (self._next + len(rows)) % most
