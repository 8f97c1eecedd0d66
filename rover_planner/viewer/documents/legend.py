# SPDX-License-Identifier: Apache-2.0
"""The legend of the ground's colours: values, the limit, classes, what grey and hatched mean."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_planner.viewer.state.colours import UNKNOWN, ColourScale, map_colours, to_css
from rover_planner.viewer.state.survey_layers import ColouredGround

STOPS = 9
"""Colours from which the gradient is made."""


def describe_scale(name: str, scale: ColourScale) -> dict[str, Any]:
    """Return the legend of a layer: title, gradient with its ends, keys (colour, words)."""
    keys = [[to_css(colour), word] for word, colour in scale.classes]
    bound = "" if scale.limit is None else f"{scale.limit:.2f} {scale.unit}".strip()
    if bound or scale.classes:
        words = "breaks a limit" if scale.classes else f"beyond the limit of {bound}"
        keys.append(["hatched", words])
    keys.append([to_css(UNKNOWN), "unknown, or the rover cannot stand"])
    gradient: Sequence[str] = []
    if not scale.classes:
        colours = map_colours(np.linspace(0.0, 1.0, STOPS), 0.0, 1.0)
        gradient = [to_css((int(r), int(g), int(b))) for r, g, b in colours]
    ends = [f"{value:.2f} {scale.unit}".strip() for value in (scale.low, scale.high)]
    return {"title": name, "gradient": gradient, "ends": ends, "keys": keys, "notes": []}


def describe_survey(
    name: str, description: str, meaning: ColouredGround, differences: Sequence[str]
) -> dict[str, Any]:
    """Return the legend of a survey's layer.

    Args:
        name: Name of the layer.
        description: What it is about.
        meaning: What its colours mean.
        differences: In what the survey differs from what the page shows.
    """
    keys = [[to_css(colour), text] for colour, text in meaning.keys]
    notes = [description]
    if differences:
        notes.append(f"not as on the page: {'; '.join(differences)}")
    return {"title": name, "gradient": [], "ends": [], "keys": keys, "notes": notes}
