# SPDX-License-Identifier: Apache-2.0
"""A remedy: the levers to set, what they cost, and the words that say so."""

from dataclasses import dataclass
from typing import Any

from rover_physics.names import WHEEL_POSITIONS
from rover_physics.numerics.plain_values import to_plain
from rover_planner.advice.case import JudgedCase
from rover_planner.advice.levers import Lever

TELLING_LOAD = 0.01
"""Least change of an axle's load that is told [share of the weight]."""


@dataclass(frozen=True)
class SetLever:
    """A lever and the value it is set to."""

    lever: Lever
    """The lever."""
    value: Any
    """Its value."""
    now: Any
    """Its value in the refused case."""


@dataclass(frozen=True, eq=False)
class Remedy:
    """Levers whose setting makes a refused path pass, as judged."""

    refusal: JudgedCase
    """The refused path."""
    levers: tuple[SetLever, ...]
    """The levers, one or a few."""
    judged: JudgedCase
    """The whole path with the levers set."""

    @property
    def needs_others(self) -> bool:
        """True if somebody outside the rover has to do, know or decide something."""
        return any(one.lever.needs_others for one in self.levers)

    @property
    def is_option(self) -> bool:
        """True if `predict` can be told all of it."""
        return all(one.lever.option or one.lever.changes_path for one in self.levers)

    @property
    def extra_time(self) -> float:
        """Time of the drive above that of the refused path [s]."""
        return float(self.judged.prediction.time[-1]) - self.refusal.time

    @property
    def extra_energy(self) -> float:
        """Energy of the drive above that of the refused path [J]."""
        return float(self.judged.prediction.energy[-1]) - self.refusal.energy

    @property
    def extra_distance(self) -> float:
        """Length of the path above that of the refused one [m]."""
        return float(self.judged.distance[-1] - self.refusal.distance[-1])

    def describe_costs(self) -> str:
        """Return time, distance, energy and chance in words."""
        distance = f"{self.extra_distance:+.1f} m, " if abs(self.extra_distance) > 0.05 else ""
        return (
            f"{round(self.extra_time):+d} s, {distance}{round(self.extra_energy):+d} J, "
            f"chance of failure {self.judged.verdict.failure_chance:.2f}"
        )

    def options(self) -> dict[str, Any]:
        """Return the options of `predict` that the levers set."""
        new = self.judged.case.options
        found = {name: getattr(new, name) for one in self.levers if (name := one.lever.option)}
        if "joint_angles" in found:
            found["joint_angles"] = new.arm_angles
        return found

    def describe(self) -> str:
        """Return what to do, what it does to the rover and how close it is, in words."""
        todo = " and ".join(
            words if k == 0 else words[0].lower() + words[1:]
            for k, words in enumerate(
                one.lever.words(self.refusal, one.value, one.now) for one in self.levers
            )
        )
        use, distance, limit = self.judged.largest_use
        loads = self._describe_loads()
        return f"{todo}{loads}; largest use {use:.2f} at {distance:.1f} m ({limit})"

    def _describe_loads(self) -> str:
        """Return how the load of the axle changes most where the refused path fails."""
        if self.judged.case.poses is not self.refusal.case.poses:
            return ""
        old, new = (one.loads_of_axles(self.refusal.place) for one in (self.refusal, self.judged))
        change = {name: new[name] - old[name] for name in WHEEL_POSITIONS}
        name = max(change, key=lambda one: abs(change[one]))
        if not abs(change[name]) > TELLING_LOAD * self.refusal.case.rover.weight:
            return ""  # or unknown
        more = "more" if change[name] > 0.0 else "less"
        return f": the {name} wheels then carry {abs(change[name]):.1f} N {more}"

    def to_dict(self) -> dict[str, Any]:
        """Return the remedy as JSON types."""
        case, use = self.judged.case, self.judged.largest_use[0]
        has_path = case.poses is not self.refusal.case.poses
        found = {
            "levers": [
                {"name": k.lever.name, "value": k.value, "unit": k.lever.unit, "from": k.now}
                for k in self.levers
            ],
            "words": self.describe(),
            "options": self.options(),
            "largest_use": use,
            "use_before": self.refusal.largest_use[0],
            "chance": self.judged.verdict.failure_chance,
            "extra_time": self.extra_time,
            "extra_energy": self.extra_energy,
            "extra_distance": self.extra_distance,
            "needs_others": self.needs_others,
        }
        plain: dict[str, Any] = to_plain(found)
        return plain | ({"poses": case.poses.tolist()} if has_path else {})
