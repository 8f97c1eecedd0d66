"""Colours that people with any kind of colour vision tell apart (Okabe and Ito, 2008; cividis)."""

import numpy as np
from numpy.typing import NDArray

Colour = tuple[int, int, int]

PASSABLE = (0, 114, 178)
"""Blue: a path that can be driven, as in the pictures of the demo."""
REFUSED = (213, 94, 0)
"""Vermillion: a path that is refused, and where."""
LOAD = (86, 180, 233)
"""Sky blue: normal forces, torque saturation."""
PULL = (230, 159, 0)
"""Orange: tangential forces, slip."""
NOTE = (204, 121, 167)
"""Reddish purple: what was refused to the visitor."""
MIDDLE = (240, 228, 66)
"""Yellow, half-way from blue to vermillion."""
METAL, DARK, BODY = (150, 155, 160), (50, 52, 56), (225, 220, 205)
UNKNOWN = (110, 110, 110)
WHEELS = ("#0072b2", "#e69f00", "#cc79a7", "#0072b2", "#e69f00", "#cc79a7")
"""One for the rear, middle and front wheels in the plots, in wheel order."""
SIDE_DASHES = ((), (5.0, 3.0))
"""Lines of the right side are drawn through, those of the left are dashed."""


def ramp(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.uint8]:
    """Return colours (..., 3) of values from `low` to `high` on cividis; grey where unknown."""
    from matplotlib import colormaps

    span = high - low if high > low else 1.0
    share = np.clip((np.nan_to_num(values) - low) / span, 0.0, 1.0)
    colours = (255 * colormaps["cividis"](share)[..., :3]).astype(np.uint8)
    colours[~np.isfinite(values)] = UNKNOWN
    return colours


def of_use(share: float) -> Colour:
    """Return the colour of a share of friction: blue where little is used, vermillion at 1.

    Grey where it is not known.
    """
    if np.isnan(share):
        return UNKNOWN
    t = float(np.clip(share, 0.0, 1.0))
    return mix(PASSABLE, MIDDLE, 2 * t) if t < 0.5 else mix(MIDDLE, REFUSED, 2 * t - 1)


def mix(first: Colour, second: Colour, share: float) -> Colour:
    """Return a colour that is so much of the second, 0 to 1, and else of the first."""
    start, end = np.array(first), np.array(second)
    red, green, blue = np.round(start + share * (end - start)).astype(int).tolist()
    return red, green, blue


def css(colour: Colour) -> str:
    """Return a colour as web pages write it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
