# SPDX-License-Identifier: Apache-2.0
"""The common style of all pictures, and writing a picture to a file."""

import io
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from rover_physics.errors import RoverFileError
from rover_physics.files.user_file import write_file
from rover_physics.files.validation import errors_of, show_file
from rover_planner.errors import PlanningError

SUFFIXES = (".png", ".svg", ".pdf")
"""Suffixes of pictures."""
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


def check_picture(path: Path) -> None:
    """Check that a picture has a format and a folder, before long work.

    Raises:
        PlanningError: It has not.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise PlanningError(f"picture {show_file(path)} must be a {', '.join(SUFFIXES)} file")
    if not path.parent.is_dir():
        raise PlanningError(
            f"{show_file(path)}: cannot be written: there is no folder {show_file(path.parent)}"
        )


def save_figure(path: Path, figure: Figure) -> None:
    """Write a picture to a file; the suffix sets the format.

    Raises:
        PlanningError: The suffix names no format, or the file cannot be written.
    """
    check_picture(path)
    picture = io.BytesIO()
    figure.savefig(picture, dpi=130, format=path.suffix[1:].lower())
    try:
        with errors_of(path):
            write_file(path, picture.getvalue())
    except RoverFileError as error:
        raise PlanningError(str(error)) from None
