# SPDX-License-Identifier: Apache-2.0
"""A survey whose layers colour the ground: opened, compared with what is shown, and read."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from rover_physics.files.validation import show_file
from rover_physics.names import OPTIMAL
from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.plain_values import to_plain
from rover_physics.prediction.sweep_options import SweepOptions
from rover_physics.rover.model import Rover
from rover_physics.terrain.grid import Terrain, fingerprint
from rover_planner.errors import PlanningError
from rover_planner.shell.extras import need
from rover_planner.survey.layers import (
    CLASS_COLOURS,
    CLASS_LABELS,
    UNKNOWN_LABEL,
    count_skipped,
    number_limits,
    read_drawn_classes,
)
from rover_planner.survey.store import SurveyStore
from rover_planner.viewer.state.colours import UNKNOWN, to_css
from rover_planner.viewer.state.layers import ColouredGround

CLASS, LIMIT = "survey: class", "survey: first limit"
"""Layers to choose from."""
OPTION_NAMES = {"policy": "torque policy", "max_torque": "largest torque"}
"""Names of options that are not those of the fields."""


class ShownSurvey:
    """The layers of a survey on the page."""

    names = (CLASS, LIMIT)
    """Names of the layers to choose from."""

    def __init__(self, path: Path, rover: Rover, terrain: Terrain | None):
        """Open a survey to show it with a rover on a map.

        Args:
            path: Folder of the store.
            rover: The rover that is shown.
            terrain: The map that is shown; None if it is the survey's own.

        Raises:
            PlanningError: It is no survey, or one of another rover or map.
        """
        self._store = SurveyStore(path)
        self._every = count_skipped(self._store.notes.layout.shape)
        recorded = self._store.notes.description
        if recorded["rover"] != to_plain(asdict(rover)):
            other = recorded["rover"]["name"]
            what = "another " + rover.name if other == rover.name else f"{other}, not {rover.name}"
            raise PlanningError(
                f"{show_file(path)} is a survey of {what}; name the rover that was surveyed"
            )
        if terrain is not None and recorded["map"] != fingerprint(terrain):
            raise PlanningError(
                f"{show_file(path)} is a survey of another map, or of one with other gaps; give "
                "the map and the --max-gap that were surveyed (default 0), or leave TERRAIN out"
            )

    def colour(
        self, name: str, rover: Rover, options: SweepOptions, places: tuple[Floats, Floats]
    ) -> ColouredGround:
        """Return the colours of a layer, and in what it differs from the page's rover and options.

        Each of the places x (mx,) and y (my,) [m] has the colour of the nearest surveyed cell
        that is read.
        """
        from matplotlib import colormaps
        from matplotlib.colors import ListedColormap, to_hex

        if name == CLASS:
            numbers = read_drawn_classes(self._store)
            palette, labels = [*CLASS_COLOURS], [*CLASS_LABELS]
        else:
            numbers = np.asarray(self._store.layer("first_limit")[:: self._every, :: self._every])
            labels = [c.replace("_", " ") or "none: all headings pass" for c in number_limits()]
            cycle = np.arange(len(labels) - 1) % colormaps["tab20"].N
            palette = [CLASS_COLOURS[0], *colormaps["tab20"](cycle)]
        colours = ListedColormap([*palette, to_css(UNKNOWN)])
        numbers = np.minimum(numbers, len(labels))
        named = [*enumerate(labels), (len(labels), UNKNOWN_LABEL)]
        keys = [(to_hex(colours(k)), label) for k, label in named if (numbers == k).any()]
        notes, (x, y), (ny, nx) = self._store.notes, places, numbers.shape
        asked = notes.description["options"]
        margin = f", control margin {asked['control_margin']:g}" if name == CLASS else ""
        about = f"{notes.headings} headings, a cell every {notes.cell:g} m{margin}"
        told = [f"{notes.description['rover']['name']}, {about}"]
        if differences := self.find_differences(rover, options):
            told.append(f"not as on the page: {'; '.join(differences)}")
        legend = {"title": name, "keys": keys, "gradient": [], "ends": [], "notes": told}
        cell, (left, low) = notes.cell * self._every, notes.frame.origin
        columns = np.rint((x - left) / cell).astype(int).clip(0, nx - 1)
        rows = np.rint((y - low) / cell).astype(int).clip(0, ny - 1)
        nearest = numbers[np.ix_(rows, columns)]
        return ColouredGround(colours(nearest, bytes=True)[..., :3], legend)

    def find_differences(self, rover: Rover, options: SweepOptions) -> tuple[str, ...]:
        """Return in what the survey differs from a rover and options that are shown."""
        recorded = self._store.notes.description
        found = []
        if recorded["rover"] != to_plain(asdict(rover)):
            found.append("the rover was changed since")
        shown = to_plain(asdict(options))
        policies = recorded["options"]["policy"], options.policy
        for key, value in recorded["options"].items():
            other = shown.get(key)
            if key == "control_margin" and OPTIMAL not in policies:
                continue
            if (value or None) != (other or None):  # no joint angles are () or None
                name = OPTION_NAMES.get(key, key.replace("_", " "))
                found.append(
                    f"{name} {_write_value(value)} in the survey, {_write_value(other)} here"
                )
        return tuple(found)


def load_map(path: Path, max_cells: int) -> Terrain:
    """Return the map of a survey.

    Args:
        path: Folder of the store.
        max_cells: Largest number of cells.

    Raises:
        PlanningError: It is no survey, its map is larger, or has changed since.
    """
    store = SurveyStore(path)
    notes = store.notes
    if notes.map_file:
        need("rasterio", "a GeoTIFF")
    source, (rows, columns) = store.open_map(), notes.layout.map_shape
    if rows * columns > max_cells:
        raise PlanningError(
            f"the map of {show_file(path)} has {rows} x {columns} cells; --max-cells is "
            f"{max_cells}"
        )
    store.check_map()
    grids: Any = source.read((slice(0, rows), slice(0, columns)))
    frame = notes.frame
    return Terrain(
        **grids, resolution=frame.resolution, origin=frame.origin, soil_names=source.soil_names
    )


def _write_value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    return "as default" if value is None else f"{value!s:.40}"
