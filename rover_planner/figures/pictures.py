"""The common style of all pictures, and writing a picture to a file."""

from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from rover_planner.errors import PlanningError

STYLE: dict[str, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.labelsize": 9.5,
    "axes.edgecolor": "#666666",
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "axes.grid": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
}
"""Settings of matplotlib (rcParams)."""


def save_figure(path: Path, figure: Figure) -> None:
    """Write a picture to a file; the suffix sets the format.

    Raises:
        PlanningError: The file cannot be written.
    """
    try:
        figure.savefig(path, dpi=130)
    except (OSError, ValueError) as error:
        raise PlanningError(f"cannot write the picture {path}: {error}") from None
