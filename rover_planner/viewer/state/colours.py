# SPDX-License-Identifier: Apache-2.0
"""Colours that people with any kind of colour vision tell apart (Okabe and Ito, 2008; cividis)."""

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]
"""Red, green and blue, 0 to 255 each."""

PASSABLE = (0, 114, 178)
"""Blue: a path that can be driven, as in the pictures of the demo."""
REFUSED = (213, 94, 0)
"""Vermillion: a path that is refused, and the pose where it is."""
BEYOND = (238, 191, 153)
"""Faded vermillion: a path behind the waypoint that is refused."""
LOAD = (86, 180, 233)
"""Sky blue: normal forces, torque saturation."""
TRACTION = (230, 159, 0)
"""Orange: tangential forces, slip."""
MIDDLE = (240, 228, 66)
"""Yellow: half-way from blue to vermillion."""
METAL, DARK, BODY = (150, 155, 160), (50, 52, 56), (225, 220, 205)
UNKNOWN = (110, 110, 110)
CASING = (16, 16, 16)
"""The line from a label to what it is about."""


def map_colours(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.uint8]:
    """Return colours (..., 3) of values on the map cividis, grey where a value is NaN.

    Args:
        values: (...) values.
        low: Value of the first colour; smaller ones have it, too.
        high: Value of the last colour; larger ones have it, too.
    """
    from matplotlib import colormaps

    span = high - low if high > low else 1.0
    scale = colormaps["cividis"].with_extremes(bad=to_css(UNKNOWN))
    return np.asarray(scale((values - low) / span, bytes=True)[..., :3])


def colour_use(use: float) -> Colour:
    """Return the colour of the use of a limit: blue at 0, yellow at 0.5, vermillion from 1.

    NaN is grey.
    """
    if np.isnan(use):
        return UNKNOWN
    channels = zip(PASSABLE, MIDDLE, REFUSED, strict=True)
    red, green, blue = (round(np.interp(use, (0.0, 0.5, 1.0), one)) for one in channels)
    return red, green, blue


def to_linear(colours: NDArray[np.int_]) -> NDArray[np.uint8]:
    """Return colours (..., 3) as shares of light, which a scene takes for the points of lines."""
    share = colours / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.asarray(np.round(255.0 * light), np.uint8)


def to_css(colour: Colour) -> str:
    """Return a colour as CSS writes it, such as #0072b2."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
