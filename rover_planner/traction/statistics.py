# SPDX-License-Identifier: Apache-2.0
"""Times and counts of a traction controller, for diagnostics and measurements."""

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_planner.traction.traction_service import (
    DISABLED,
    EMERGENCY_STOP,
    STALLED,
    TractionCommand,
)

MAX_TIMES = 6000
"""Number of updates whose times are kept: one minute at 100 Hz."""
ADVICE = {
    DISABLED: "disabled: call ~/enable to drive",
    EMERGENCY_STOP: "emergency_stop: release it, then call ~/enable",
    STALLED: "stalled: no progress; command zero or the other direction to drive again",
}
"""What is told of states in which the rover rests without a fault."""


class TractionStatistics:
    """Counts updates and keeps their times."""

    def __init__(self, period: float):
        """Start at zero; `period` [s] is that of the updates."""
        self._period = period
        self._last_start: float | None = None
        self._times: deque[float] = deque(maxlen=MAX_TIMES)
        """Durations of the last updates, including publishing [s]."""
        self.missed = 0
        """Cycles without an update because an update came late."""
        self.fallbacks = 0
        """Updates with equal torques because OSQP failed."""
        self.updates = 0
        """Updates in all."""
        self.last: TractionCommand | None = None
        """The last one."""

    def take(self, update: TractionCommand, start: float, end: float) -> None:
        """Count an update that lasted from start to end [s]."""
        if self._last_start is not None:
            self.missed += max(round((start - self._last_start) / self._period) - 1, 0)
        self._last_start = start
        self._times.append(end - start)
        self.updates += 1
        self.fallbacks += update.answer is not None and update.answer.fallback
        self.last = update

    def describe(self) -> dict[str, Any]:
        """Return counts, times [ms] and the last update by name."""
        values: dict[str, Any] = {
            "updates": self.updates,
            "missed_cycles": self.missed,
            "fallbacks": self.fallbacks,
        }
        if self._times:
            median, p99 = (1e3 * np.quantile(self._times, (0.5, 0.99))).round(3).tolist()
            values |= {"update_time_median_ms": median, "update_time_p99_ms": p99}
        return values if self.last is None else values | _describe_update(self.last)


def _describe_update(update: TractionCommand) -> dict[str, Any]:
    """Return the results of an update by name; empty if there is a fault."""
    answer, estimate = update.answer, update.estimate
    if answer is None or estimate is None:
        return {}
    return {
        "solve_time_ms": round(1e3 * update.duration, 3),
        "iterations": answer.iterations,
        "programs": answer.programs,
        "status": answer.status,
        "fallback": answer.fallback,
        "contact_source": estimate.source,
        "peak_friction_utilisation": round(float(answer.utilisation.max()), 4),
        "friction_slack": round(answer.friction_slack, 4),
        "load_slack_N": round(answer.load_slack, 3),
        "torque_slack_Nm": round(answer.torque_slack, 4),
    }


def judge_update(update: TractionCommand, problems: Sequence[str]) -> tuple[str, str]:
    """Return level and text of an update for diagnostics, with problems that stop no rover.

    It is an error if there is a fault; a warning if the rover is stalled, is stopped by the
    emergency stop, drives with equal torques or has a problem.
    """
    answer, state = update.answer, update.state
    if update.fault:
        return "error", f"{state}: {update.fault}"
    if state in (EMERGENCY_STOP, STALLED):
        return "warning", ADVICE[state]
    if answer is not None and answer.fallback:
        return "warning", "equal torques: not solved"
    if problems:
        return "warning", f"{state}: {'; '.join(problems)}"
    if update.estimate is not None:
        return "ok", f"{state}: contact angles from {update.estimate.source}"
    return "ok", ADVICE.get(state, state)
