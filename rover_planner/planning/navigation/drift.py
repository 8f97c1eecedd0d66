# SPDX-License-Identifier: Apache-2.0
"""The difference of measured and predicted suspension angles over a time."""

import math
from collections import deque
from collections.abc import Mapping

from rover_planner.planning.verdict_report import SuspensionReport


class SuspensionDrift:
    """Keeps the differences of the last seconds."""

    def __init__(self, seconds: float):
        """Keep the differences of so many seconds."""
        self._seconds = seconds
        self._kept: deque[tuple[float, Mapping[str, float]]] = deque()

    def take(self, report: SuspensionReport | None, now: float) -> None:
        """Keep a comparison made at time `now` [s]; None if there was none."""
        if report is not None:
            self._kept.append((now, report.suspension_mismatch))
        while self._kept and now - self._kept[0][0] > self._seconds:
            self._kept.popleft()

    def forget(self) -> None:
        """Forget all differences."""
        self._kept.clear()

    @property
    def latest(self) -> Mapping[str, float]:
        """The last difference, measured minus predicted, by joint [rad]; empty without one."""
        return self._kept[-1][1] if self._kept else {}

    @property
    def size(self) -> float:
        """Size of the last difference: the largest of the joints [rad], NaN if there is none."""
        return max((abs(value) for value in self.latest.values()), default=math.nan)

    def lasting(self) -> float:
        """Return the size that was exceeded all the time [rad]; 0 before the time is over."""
        if not self._kept or self._kept[-1][0] - self._kept[0][0] < 0.8 * self._seconds:
            return 0.0
        return min(max(abs(value) for value in kept.values()) for _, kept in self._kept)
