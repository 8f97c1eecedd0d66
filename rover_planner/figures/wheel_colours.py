# SPDX-License-Identifier: Apache-2.0
"""The colours and line styles of the wheels in every picture of the project, and on the page."""

WHEEL_COLOURS = {"rear": "#0072b2", "middle": "#e69f00", "front": "#cc79a7"}
"""Colours of rear, middle and front wheels (Okabe and Ito, 2008)."""
LEFT_DASHES = (5.0, 3.0)
"""Dash and gap of the lines of the left side [px or points]; those of the right side are solid."""


def colour_of(wheel: str) -> str:
    """Return the colour of a wheel by its name, such as rear_left, or by its position."""
    return WHEEL_COLOURS[wheel.partition("_")[0]]
