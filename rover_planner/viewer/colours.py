"""Colours that people with any kind of colour vision tell apart (Okabe and Ito, 2008; cividis)."""

import numpy as np
from numpy.typing import NDArray

PASSABLE = (0, 158, 115)
"""Bluish green: a path that can be driven."""
CHOSEN = (0, 114, 178)
"""Blue: the path that is shown."""
REFUSED = (213, 94, 0)
"""Vermillion: a path that is refused, and where."""
LOAD = (86, 180, 233)
"""Sky blue: normal forces, torque saturation."""
PULL = (230, 159, 0)
"""Orange: tangential forces, slip."""
METAL, DARK, BODY = (150, 155, 160), (50, 52, 56), (225, 220, 205)
UNKNOWN = (110, 110, 110)
WHEELS = ("#0072b2", "#56b4e9", "#009e73", "#d55e00", "#e69f00", "#cc79a7")
"""One for each wheel in the plots, in wheel order."""


def ramp(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.uint8]:
    """Return colours (..., 3) of values from `low` to `high` on cividis; grey where unknown."""
    from matplotlib import colormaps

    span = high - low if high > low else 1.0
    share = np.clip((np.nan_to_num(values) - low) / span, 0.0, 1.0)
    colours = (255 * colormaps["cividis"](share)[..., :3]).astype(np.uint8)
    colours[~np.isfinite(values)] = UNKNOWN
    return colours


def of_use(share: float) -> tuple[int, int, int]:
    """Return the colour of a share of friction: blue where little is used, vermillion at 1."""
    t = float(np.clip(share, 0.0, 1.0))
    low, middle, high = np.array(CHOSEN), np.array((240, 228, 66)), np.array(REFUSED)
    mixed = low + 2 * t * (middle - low) if t < 0.5 else middle + (2 * t - 1) * (high - middle)
    red, green, blue = np.round(mixed).astype(int).tolist()
    return red, green, blue


def css(colour: tuple[int, int, int]) -> str:
    """Return a colour as web pages write it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
