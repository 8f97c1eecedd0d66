# SPDX-License-Identifier: Apache-2.0
"""The rovers and drives before and after changes: history, undo, and differences in numbers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_to_dict
from rover_planner.studies.rover_values import get_value, list_values
from rover_planner.viewer.state.scenario import Scenario, Shown
from rover_planner.viewer.state.trajectory import Trajectory

MAX_STEPS = 50
"""Most changes that can be undone."""


@dataclass(frozen=True)
class Difference:
    """A number of the drive before and after a change; NaN where there is none."""

    name: str
    """Its name."""
    unit: str
    """Its unit, empty for none."""
    before: float
    """With the rover before."""
    after: float
    """With the rover now."""
    digits: int = 2
    """Digits that are shown behind the point."""

    @property
    def change(self) -> float:
        """The difference."""
        return self.after - self.before


class ChangeHistory:
    """The rovers of the last finished judgements, for comparison and undo."""

    def __init__(self, judgement: Shown):
        """Begin with a judgement."""
        self._done = [judgement]
        """Showns of different rovers on the same paths, the newest last."""

    def take(self, judgement: Shown) -> None:
        """Note a judgement of all paths; one of other paths begins anew.

        While a slider is dragged, only the shown path is judged: those are no steps.
        """
        asked, last = judgement.scenario, self._done[-1].scenario
        if not asked.has_paths_of(last):
            self._done = [judgement]
        elif not _differ(asked, last):
            self._done[-1] = judgement
        elif judgement.answered is asked:
            self._done = [*self._done[-MAX_STEPS:], judgement]

    def reference_for(self, judgement: Shown) -> Shown | None:
        """Return the last judgement of another rover than that of a judgement, on its path."""
        now = judgement.scenario
        for one in reversed(self._done):
            then = one.scenario
            if _differ(then, now):
                same = then.has_paths_of(now) and one.index == judgement.index
                return one if same else None
        return None

    def undo(self, wanted: Scenario) -> Shown | None:
        """Return the judgement of the rover before the newest one, and forget the newest.

        The newest one is that which is wanted, also while not all of its paths are judged.

        Args:
            wanted: What visitors want judged.

        Returns:
            None if there is no rover before, or another one was loaded since.
        """
        last = self._done[-1].scenario
        if wanted.loaded is not last.loaded:
            return None
        if _differ(wanted, last):
            return self._done[-1]
        if len(self._done) < 2:
            return None
        self._done.pop()
        return self._done[-1]


def _differ(one: Scenario, other: Scenario) -> bool:
    """Return whether two scenarios have different numbers of the rover or angles of its arm."""
    return one.rover != other.rover or dict(one.arm_angles) != dict(other.arm_angles)


def list_changes(loaded: Rover, now: Rover) -> dict[str, tuple[float, float]]:
    """Return the changed numbers of a rover by their labels: as loaded, and now."""
    old, new = rover_to_dict(loaded), rover_to_dict(now)
    found = {}
    for values in list_values(loaded).values():
        for value in values:
            was, here = (get_value(data, value.keys[0]) for data in (old, new))
            if abs(was - here) > 1e-9:
                found[value.label] = (was, here)
    return found


def compare_drives(before: Trajectory, after: Trajectory) -> tuple[Difference, ...]:
    """Return the numbers of two drives along one path, each up to its first failure."""
    rows: Mapping[tuple[str, str, int], Callable[[Trajectory], float]] = {
        ("driven", "m", 2): lambda t: _last(t, "distance"),
        ("time", "s", 1): lambda t: _last(t, "time"),
        ("energy", "J", 1): lambda t: _last(t, "energy"),
        ("friction, largest", "", 2): lambda t: t.verdict.max_friction_utilisation,
        ("torque, largest", "", 2): lambda t: t.verdict.max_torque_saturation,
        ("margin, smallest", "", 2): lambda t: t.verdict.min_tip_over_ratio,
        ("tilt, largest", "deg", 1): lambda t: float(np.degrees(t.verdict.max_tilt)),
        ("belly, lowest", "cm", 1): lambda t: 100.0 * t.verdict.min_belly_clearance,
    }
    return tuple(
        Difference(name, unit, read(before), read(after), digits)
        for (name, unit, digits), read in rows.items()
    )


def _last(trajectory: Trajectory, name: str) -> float:
    return float(trajectory.series(name)[-1])
