# SPDX-License-Identifier: Apache-2.0
"""Remembers what a model has found at poses, so that it is not asked twice about one.

What the model finds at a pose depends on pose and motion alone, and on the ground near the pose.
A path is made of pieces that were judged before, and after a change of the map most of it is as it
was. What is found between two neighbouring waypoints depends on both of them, and is remembered as
long as the map stays.
"""

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.prediction.path_kernels import Crossings
from rover_physics.results.record import RESULT, numbers_of, place_results, unwritten_results

MOST = 20_000
"""Number of poses that are remembered; beyond, the oldest are forgotten. A pose takes 1.6 kB."""
ASKED, STRETCH = np.dtype("V48"), np.dtype("V96")
"""The numbers of a pose and of its motion as one value, and those of two waypoints."""

Evaluate = Callable[[Floats, Floats], np.ndarray]
"""Returns RESULTs (n,) of poses (n, 3) with motions (n, 3)."""


class KnownStretches:
    """Poses between neighbouring waypoints, by poses and motions of both."""

    def __init__(self, most: int = MOST):
        """Begin with none; `most` is the number of poses that are remembered."""
        self._most, self._poses = most, 0
        self._found: dict[bytes, Crossings] = {}

    def __len__(self) -> int:
        return self._poses

    def recall(self, ends: Floats, waypoints: NDArray[np.int64]) -> Iterator[Crossings | None]:
        """Yield the poses of stretches, None of those that are not known.

        `ends` (n, 12) are pose and motion of the two waypoints, `waypoints` (n,) their place on
        the path: the indices of the second ones.
        """
        for key, waypoint in zip(_keys(ends, STRETCH), waypoints.tolist(), strict=True):
            found = self._found.get(key)
            yield None if found is None else found.shift(waypoint)

    def keep(self, ends: Floats, waypoints: NDArray[np.int64], found: Crossings) -> None:
        """Keep what was found of stretches, as for `recall`; in the order of the path."""
        bounds = np.searchsorted(found.waypoint, [waypoints, waypoints + 1]).T.tolist()
        keys = _keys(ends, STRETCH)
        for key, waypoint, (first, end) in zip(keys, waypoints.tolist(), bounds, strict=True):
            if key not in self._found:
                rows = Crossings._make(part[first:end] for part in found)
                self._found[key] = rows.shift(-waypoint)
                self._poses += 1 + end - first
        while self._poses > self._most:
            self._poses -= 1 + len(self._found.pop(next(iter(self._found))).place)

    def forget(self) -> None:
        """Forget all."""
        self._found, self._poses = {}, 0


class KnownPoses:
    """RESULTs of the last poses that one model was asked about, by pose and motion."""

    def __init__(self, most: int = MOST, others: "KnownPoses | None" = None):
        """Begin with none; `most` is the number of poses that are remembered.

        What is not known, `others` of the same model may know.
        """
        self._others = others
        self.stretches = KnownStretches() if others is None else others.stretches
        """What is known between waypoints."""
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
        keys = _keys(np.hstack([poses, motions]), ASKED)
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
        """Forget the poses of which `are_near` is True at x, y (n, 2) [m], and all stretches."""
        self.stretches.forget()
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


def _keys(numbers: Floats, kind: np.dtype) -> list[bytes]:
    """Return rows of numbers, each as one value."""
    keys: list[bytes] = numbers.view(kind)[:, 0].tolist()
    return keys
