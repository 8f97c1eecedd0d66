# SPDX-License-Identifier: Apache-2.0
"""Friction that was learned of the ground, as `learn` writes it and questions assume it."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

from rover_physics.files.validation import show_file
from rover_physics.numerics.plausible import MAX_FRICTION, MIN_FRICTION
from rover_physics.rover.model import Rover
from rover_planner.errors import PlanningError

MOST_SPREAD = 0.35
"""Largest relative standard deviation of friction that a rover file takes."""


@dataclass(frozen=True)
class LearnedGround:
    """Friction as it was learned, and when."""

    mean: float
    """Mean."""
    std: float
    """Standard deviation."""
    low: float
    """Lower end of the 95 % interval."""
    is_bounded: bool
    """True if wheels slipped, so that the mean was measured."""
    since: str = ""
    """Time of the estimate, "seconds.nanoseconds"; empty if it has none."""

    def change(self, rover: Rover) -> Rover:
        """Return a rover with this friction, and its uncertainty for chances.

        While nothing has slipped, the rover keeps its friction, or takes what was proved if that
        is more.
        """
        mean = self.mean if self.is_bounded else max(rover.friction, self.low)
        spread = min(self.std / self.mean, MOST_SPREAD)
        uncertainty = replace(rover.uncertainty, friction=spread)
        return replace(rover, friction=mean, uncertainty=uncertainty)


def parse_learned(text: str, source: str, since: str = "") -> LearnedGround:
    """Read what `describe` has written as JSON.

    Raises:
        PlanningError: It has no friction with mean, std, low and high, or values that cannot be.
    """
    try:
        friction = json.loads(text)["friction"]
        mean, std, low = (float(friction[name]) for name in ("mean", "std", "low"))
        bounded = friction["high"] is not None
    except (ValueError, KeyError, TypeError) as error:
        raise PlanningError(
            f"{source}: has no friction with mean, std, low and high, as learn writes it: {error}"
        ) from None
    if not (MIN_FRICTION <= mean <= MAX_FRICTION and 0.0 <= std <= MAX_FRICTION and low <= mean):
        raise PlanningError(
            f"{source}: friction has mean {mean:g}, std {std:g}, low {low:g}; mean must be above "
            "0, std at least 0, low at most the mean"
        )
    return LearnedGround(mean, std, low, bounded, since)


def rover_on_learned_ground(rover: Rover, path: Path) -> Rover:
    """Return a rover with the friction of a file; see `LearnedGround.change`.

    Raises:
        PlanningError: The file cannot be read or is none of `learn`.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeError) as error:
        raise PlanningError(f"{show_file(path)}: cannot be read: {error}") from None
    return parse_learned(text, str(show_file(path))).change(rover)
