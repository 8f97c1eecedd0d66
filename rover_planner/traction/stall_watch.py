"""Decides when to stop pushing: the rover is commanded to move and has not for too long."""

from rover_planner.traction.loops import STALL_RATIO


class StallWatch:
    """Counts the time without progress; stalled until the command is zero or reverses."""

    def __init__(self) -> None:
        """Start with a rover that moves."""
        self._time = 0.0
        self._blocked_direction = 0.0

    def reset(self) -> None:
        """Forget the stall."""
        self._time, self._blocked_direction = 0.0, 0.0

    def update(self, rate: float, wanted: float, duration: float, stall_time: float) -> bool:
        """Return whether the rover is stalled.

        Args:
            rate: Median wheel rate [rad/s].
            wanted: Wanted wheel rate [rad/s].
            duration: Time since the last call [s].
            stall_time: Time without progress after which the rover is stalled [s].
        """
        if wanted * self._blocked_direction > 0.0:
            return True
        self._blocked_direction = 0.0
        stands = wanted != 0.0 and rate / wanted < STALL_RATIO
        self._time = max(self._time + (duration if stands else -duration), 0.0)
        if wanted == 0.0:
            self._time = 0.0
        if self._time >= stall_time:
            self._time, self._blocked_direction = 0.0, wanted
        return self._blocked_direction != 0.0
