# SPDX-License-Identifier: Apache-2.0
"""The legend of the ground's colours: values, the limit, classes, what grey and hatched mean."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from rover_planner.viewer.state.colours import UNKNOWN, ColourScale, map_colours, to_css
from rover_planner.viewer.state.layers import Colouring
from rover_planner.viewer.state.survey_layers import ColouredGround

STOPS = 9
"""Colours from which the gradient is made."""


def describe_scale(how: Colouring, scale: ColourScale) -> dict[str, Any]:
    """Return the legend of a layer: title, gradient with its ends, keys (colour, words)."""
    keys = [["hatched", "beyond the limit"]] if how.is_predicted else []
    keys.append([to_css(UNKNOWN), "unknown, or the rover cannot stand"])
    colours = map_colours(np.linspace(0.0, 1.0, STOPS), 0.0, 1.0)
    gradient = [to_css((int(r), int(g), int(b))) for r, g, b in colours]
    ends = [f"{value:.{scale.digits}f} {scale.unit}".strip() for value in (scale.low, scale.high)]
    title = how.describe()
    return {"title": title, "gradient": gradient, "ends": ends, "keys": keys, "notes": []}


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
