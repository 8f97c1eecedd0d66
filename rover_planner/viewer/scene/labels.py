# SPDX-License-Identifier: Apache-2.0
"""Labels at places in the scene, in groups that are replaced as a whole."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rover_physics.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class Label:
    """One label."""

    words: str
    """Its text; may have several lines."""
    place: Floats
    """(3,) where it belongs [m], frame of the scene."""
    size: float = 1.0
    """Size of its letters, 1 for 12 px."""
    stands: bool = True
    """True if it stands on its place; else its middle is there."""


class Labels:
    """The labels of a scene."""

    def __init__(self, scene: Any):
        """Show none yet."""
        self._scene = scene
        self._groups: dict[str, list[Any]] = {}

    def show(self, group: str, labels: Mapping[str, Label]) -> None:
        """Show labels by name instead of those that the group had; none removes them."""
        for node in self._groups.pop(group, ()):
            node.remove()
        self._groups[group] = [
            self._scene.add_label(
                f"{group}/{name}", label.words, position=label.place,
                font_screen_scale=label.size,
                anchor="bottom-center" if label.stands else "center-center",
            )
            for name, label in labels.items()
        ]  # fmt: skip
