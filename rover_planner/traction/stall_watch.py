"""Decides when to stop pushing: the rover is commanded to move and has not for too long."""

from statistics import median

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.traction.loops import STALL_RATIO

RIGHT_WHEELS = WHEEL_COUNT // 2
"""Number of wheels on the right side, which are the first ones."""
SLOW_SHARE = 0.1
"""Wheels whose wanted rate is below this share of the other side's are not looked at."""


class StallWatch:
    """Counts the time without progress; stalled until the command is zero or reverses."""

    def __init__(self) -> None:
        """Start with a rover that moves."""
        self._time = 0.0
        self._blocked = (0.0, 0.0)

    def reset(self) -> None:
        """Forget the stall."""
        self._time, self._blocked = 0.0, (0.0, 0.0)

    def reset_time(self) -> None:
        """Start to count anew, for a rover that climbs."""
        self._time = 0.0

    def update(
        self, rates: Floats, wanted: tuple[float, float], duration: float, stall_time: float
    ) -> bool:
        """Return whether the rover is stalled.

        Args:
            rates: (6,) wheel rates [rad/s].
            wanted: Wanted rates of the wheels on the right and on the left side [rad/s].
            duration: Time since the last call [s].
            stall_time: Time without progress after which the rover is stalled [s].
        """
        if wanted[0] * self._blocked[0] + wanted[1] * self._blocked[1] > 0.0:
            return True
        self._blocked = (0.0, 0.0)
        if not any(wanted):
            self._time = 0.0
            return False
        stands = _find_progress(rates, wanted) < STALL_RATIO
        self._time = max(self._time + (duration if stands else -duration), 0.0)
        if self._time < stall_time:
            return False
        self._time, self._blocked = 0.0, wanted
        return True


def _find_progress(rates: Floats, wanted: tuple[float, float]) -> float:
    """Return the median of the wheels' rates over their wanted rates."""
    slowest = SLOW_SHARE * max(map(abs, wanted))
    shares = []
    for wheel, rate in enumerate(rates.tolist()):
        own = wanted[0] if wheel < RIGHT_WHEELS else wanted[1]
        if abs(own) > slowest:
            shares.append(rate / own)
    return median(shares)
