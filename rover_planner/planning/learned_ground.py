# SPDX-License-Identifier: Apache-2.0
"""Friction that was learned of the ground, as `learn` writes it and questions assume it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from rover_physics.files.validation import show_file
from rover_physics.numerics.arrays import seal_array
from rover_physics.numerics.plausible import MAX_FRICTION, MIN_FRICTION
from rover_physics.rover.model import Rover
from rover_physics.rover.uncertainty import MAX_DEVIATION
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError


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
    classes: Mapping[int, "LearnedGround"] = field(default_factory=dict)
    """The same by class of ground."""

    def assume(self, told: float) -> float:
        """Return the friction to assume where another one was told.

        While nothing has slipped it is the told one, or what was proved if that is more.
        """
        return self.mean if self.is_bounded else max(told, self.low)

    def change(self, rover: Rover) -> Rover:
        """Return a rover with the friction to assume, and its uncertainty for chances.

        What is not measured is as uncertain as the told friction. With classes of ground it is the
        largest uncertainty of what is assumed on any of them.
        """
        grounds = self, *self.classes.values()
        spreads = [one.std / one.mean for one in grounds if one.is_bounded]
        if self.classes or not spreads:
            spreads.append(rover.uncertainty.friction)
        spread = max(spreads)
        uncertainty = replace(rover.uncertainty, friction=min(spread, MAX_DEVIATION))
        return replace(rover, friction=self.assume(rover.friction), uncertainty=uncertainty)

    def assume_classes(self, terrain: Terrain, told: float) -> dict[int, float]:
        """Return the friction to assume on each class of a map; a class not met has the told."""
        return {
            number: self.classes[number].assume(told) if number in self.classes else told
            for number in terrain.classes
        }


def lay_friction(terrain: Terrain, by_class: Mapping[int, float]) -> Terrain:
    """Return a map with the friction of each class where it has none of its own."""
    classes, friction = terrain.ground_class, terrain.friction
    if classes is None or not by_class:
        return terrain
    laid = np.full(classes.shape, np.nan) if friction is None else friction.copy()
    for number, value in by_class.items():
        laid[(classes == number) & np.isnan(laid)] = value
    return replace(terrain, friction=seal_array(laid))


def parse_learned(text: str, source: str, since: str = "") -> LearnedGround:
    """Read what `describe` has written as JSON.

    Raises:
        PlanningError: It has no friction with mean, std, low and high, or values that cannot be.
    """
    try:
        found = json.loads(text)
        classes = {
            int(number): _read_friction(one, f"{source}: class {number}")
            for number, one in found.get("classes", {}).items()
        }
        return replace(_read_friction(found["friction"], source), since=since, classes=classes)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise PlanningError(
            f"{source}: has no friction with mean, std, low and high, as learn writes it: {error}"
        ) from None


def _read_friction(friction: Mapping[str, Any], source: str) -> LearnedGround:
    mean, std, low = (float(friction[name]) for name in ("mean", "std", "low"))
    if not (MIN_FRICTION <= mean <= MAX_FRICTION and 0.0 <= std <= MAX_FRICTION and low <= mean):
        raise PlanningError(
            f"{source}: friction has mean {mean:g}, std {std:g}, low {low:g}; mean must be above "
            "0, std at least 0, low at most the mean"
        )
    return LearnedGround(mean, std, low, friction["high"] is not None)


def read_learned(path: Path) -> LearnedGround:
    """Read a file of `learn`.

    Raises:
        PlanningError: The file cannot be read or is none of `learn`.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeError) as error:
        raise PlanningError(f"{show_file(path)}: cannot be read: {error}") from None
    return parse_learned(text, str(show_file(path)))
