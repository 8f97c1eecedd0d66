# SPDX-License-Identifier: Apache-2.0
"""Labels at places in the scene; the page draws them over it, and its script keeps them apart."""

import html
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rover_physics.numerics.arrays import Floats
from rover_planner.viewer.state.colours import CASING, Colour, to_css


@dataclass(frozen=True, eq=False)
class Label:
    """One label."""

    words: str
    """Its text; may have several lines."""
    place: Floats
    """(3,) where it belongs [m], frame of the scene."""
    rank: int = 2
    """Order in which labels get their places on the screen; the first keep to theirs."""
    path: int = 0
    """Number of the path that it names, from 1; 0: it names none."""
    colour: Colour = CASING
    """Colour of its edge."""
    is_shown: bool = False
    """Whether its path is the shown one."""
    stands: bool = True
    """Whether it stands on its place; else its middle is there."""


class Labels:
    """The labels of a scene, in groups; a hidden part of the page holds them for the script."""

    def __init__(self, gui: Any):
        """Show none yet; add the hidden part to the container that is open in the GUI of viser."""
        self._box = gui.add_html("")
        self._groups: dict[str, Mapping[str, Label]] = {}

    def show(self, group: str, labels: Mapping[str, Label]) -> None:
        """Show labels by name instead of those that the group had; none removes them."""
        self._groups[group] = labels
        self._box.content = self.html

    def _all(self) -> dict[str, Label]:
        return {
            f"{group}/{name}": label
            for group, labels in self._groups.items()
            for name, label in labels.items()
        }

    @property
    def html(self) -> str:
        """All labels for the script."""
        return write_labels(self._all())


def write_labels(labels: Mapping[str, Label]) -> str:
    """Return labels by name as HTML for the script (browser/label_script.py)."""
    data = [
        {
            "name": name,
            "words": label.words,
            "place": [round(float(value), 4) for value in label.place],
            "rank": label.rank,
            "path": label.path,
            "colour": to_css(label.colour),
            "shown": label.is_shown,
            "stands": label.stands,
        }
        for name, label in labels.items()
    ]
    return f'<div id="scene-labels" hidden data-labels="{html.escape(json.dumps(data))}"></div>'
