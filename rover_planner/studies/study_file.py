# SPDX-License-Identifier: Apache-2.0
"""Studies and their files: a rover, its varied numbers, the drives and the objective."""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import Field

from rover_physics.errors import RoverFileError
from rover_physics.files.config_files import find_config
from rover_physics.files.rules import ListOfMappings, Metres, Radians, Rule, Text, choice, number
from rover_physics.files.validation import Key, errors_of, read_as, refuse, show_file
from rover_physics.files.yaml_file import read_yaml
from rover_physics.names import CONTROL_POLICIES, EQUAL
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover, rover_to_dict
from rover_physics.terrain.soil_file import soil_named
from rover_planner.studies.rover_values import find_key, get_value

OBJECTIVES = {
    "worst_utilisation": ("smallest", "largest friction utilisation on the drives", ""),
    "tip_over_margin": ("largest", "smallest tip-over angle on the drives", "rad"),
    "drive_energy": ("smallest", "largest energy of a metre of the drives", "J/m"),
    "tallest_step": ("largest", "tallest step climbed", "m"),
    "load_imbalance": ("smallest", "largest wheel load over the mean, level ground", ""),
}
"""Objectives by name: best value, description, unit."""
STEP_TOLERANCE = 0.002
"""Tolerance of the height of the tallest step [m]."""
MAX_TRIALS = 100_000
"""Largest number of rovers that a study tries."""
ABOUT_DRIVES = ("worst_utilisation", "tip_over_margin", "drive_energy")
"""Objectives that need drives."""


def name_thing(name: str) -> str:
    """Return the dotted name of a number of a rover file in words, such as "rear wheel x"."""
    *path, last = name.replace("_", " ").split(".")
    if path[:2] == ["suspension", "wheels"]:
        return " ".join((*path[2:], "wheel", last))
    parts = path[1:] if path[:1] in (["suspension"], ["masses"]) else path
    if path[:1] == ["limits"]:
        return f"{last} limit"
    words = ["centre" if part == "com" else part for part in parts]
    return " ".join((*words, last))


def label_of(name: str, unit: str) -> str:
    """Return a name with its unit, as in heads of tables and at axes."""
    return f"{name} [{unit}]" if unit else name


def _whole(least: int, most: int) -> Rule:
    return Rule(
        f"a whole number from {least} to {most}", holds=range(least, most + 1).__contains__
    )


def _are_names(texts: Sequence[str]) -> bool:
    return len(texts) > 0 and len(set(texts)) == len(texts)


_NUMBER = Rule("a number in the unit of that number of the rover", holds=math.isfinite)


@dataclass(frozen=True, kw_only=True)
class ParameterEntry:
    """A varied number of the rover, as written in a study file."""

    name: Text
    """Dotted name, such as suspension.bogie_pivot.z."""
    low: Annotated[float, Field(alias="from"), _NUMBER]
    """Smallest value."""
    high: Annotated[float, Field(alias="to"), _NUMBER]
    """Largest value."""
    count: Annotated[int, _whole(2, 1000)] = 11
    """Number of values in a sweep, including both ends."""
    also: Annotated[
        tuple[Text, ...], Rule("a list of one name or more, all different", holds=_are_names)
    ] = ()
    """Names of further numbers that get the same value."""


@dataclass(frozen=True, kw_only=True)
class StudyParameter(ParameterEntry):
    """A varied number of the rover with its keys, unit and current value."""

    keys: tuple[Key, ...]
    """Its key in the rover file, then those of the further numbers."""
    unit: str
    """Its unit."""
    now: float
    """Its value in the rover file."""


@dataclass(frozen=True, kw_only=True)
class StudyDrive:
    """A straight drive over a slope, a step or the terrain of a file; one of the three is set."""

    slope: Annotated[float, number("rad", least=-1.5, most=1.5)] | None = None
    """Angle of the slope [rad]."""
    step: Metres | None = None
    """Height of the step across x = 0 [m]."""
    file: Text | None = None
    """Terrain file."""
    start: Annotated[tuple[Metres, Metres, Radians], Rule("a list of 3 numbers in m, m, rad")] = (
        0.0,
        0.0,
        0.0,
    )
    """Start: x, y [m] and yaw [rad]."""
    length: Annotated[float, number("m", above=0.0)] = 2.0
    """[m]"""


@dataclass(frozen=True, kw_only=True)
class StudyOptions:
    """The objective of a study and the options of its evaluation."""

    objective: Annotated[str, choice(*OBJECTIVES)]
    """One of OBJECTIVES."""
    method: Annotated[str, choice("sweep", "optimise")] = "sweep"
    """A sweep tries all combinations of the parameters; an optimisation searches the best one."""
    policy: Annotated[str, choice(*CONTROL_POLICIES)] = EQUAL
    """Torque policy: the shares of the wheels in the traction."""
    friction: Annotated[float, number("", above=0.0)] | None = None
    """Coulomb friction; None takes that of the rover."""
    soil: Text | None = None
    """Preset soil of the ground; None is firm ground."""
    evaluations: Annotated[int, _whole(3, MAX_TRIALS)] = 60
    """Maximum number of evaluations of an optimisation."""


@dataclass(frozen=True, kw_only=True)
class Study(StudyOptions):
    """One study."""

    rover: Rover
    """The rover whose numbers are varied."""
    parameters: tuple[StudyParameter, ...]
    """The varied numbers."""
    drives: tuple[StudyDrive, ...]
    """The drives; empty if the objective needs none."""

    @property
    def wants_largest(self) -> bool:
        """True if larger values of the objective are better."""
        return OBJECTIVES[self.objective][0] == "largest"

    @property
    def resolution(self) -> float:
        """Tolerance of the objective, in its unit; 0 where it is computed exactly."""
        return STEP_TOLERANCE if self.objective == "tallest_step" else 0.0


@dataclass(frozen=True, kw_only=True)
class _StudyFile(StudyOptions):
    """The keys of a study file."""

    rover: Text
    parameters: Annotated[tuple[ParameterEntry, ...], ListOfMappings()]
    drives: Annotated[tuple[StudyDrive, ...], ListOfMappings()] | None = None


def find_examples() -> dict[str, Path]:
    """Return the files of the studies that come with the package, beside config/, by name."""
    folder = find_config("rovers").parents[1] / "examples"
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_study(path: Path) -> Study:
    """Read a study file; its keys are documented in docs/studies.md.

    Raises:
        RoverFileError: The file cannot be read, or a key is missing, unknown or invalid.
    """
    if not os.path.exists(path):
        raise RoverFileError(f"no study file {show_file(path)}")
    return study_from_dict(read_yaml(path), str(path), path.parent)


def study_from_dict(data: object, source: str, folder: Path = Path()) -> Study:
    """Build a study from the contents of a study file.

    Args:
        data: Nested mapping with the keys of a study file (docs/studies.md).
        source: Name of the source; each error text starts with it.
        folder: Folder that is searched first for rover and terrain files.

    Raises:
        RoverFileError: A key is missing, unknown or invalid; the text names it.
        SoilError: The soil is not one of the presets.
    """
    with errors_of(source):
        file: _StudyFile = read_as(_StudyFile, data, "a study file")
        _check_use(file)
        rover = load_rover(_beside(file.rover, folder))
        found = {
            "rover": rover,
            "parameters": _find_parameters(file.parameters, rover),
            "drives": tuple(
                drive if drive.file is None else replace(drive, file=_beside(drive.file, folder))
                for drive in file.drives or ()
            ),
        }
        return Study(**{**vars(file), **found})


def _check_use(file: _StudyFile) -> None:
    """Check that drives are given if needed, and drives and soil only if they are used."""
    count = math.prod(parameter.count for parameter in file.parameters)
    if file.method == "sweep" and count > MAX_TRIALS:
        raise RoverFileError(
            f"parameters have {count:.3g} combinations; a sweep tries at most {MAX_TRIALS}: lower "
            "their counts"
        )
    if file.soil is not None:
        soil_named(file.soil)
    if file.objective in ABOUT_DRIVES and not file.drives:
        raise RoverFileError(
            f"drives is missing; the objective {file.objective} is about what is driven"
        )
    for key in ("drives", "soil"):
        value = getattr(file, key)
        if file.objective not in ABOUT_DRIVES and value is not None:
            shown = value if key == "soil" else f"a list of {len(value)}"
            raise refuse(key, shown, f"left out: the objective {file.objective} does not use it")
    for k, drive in enumerate(file.drives or ()):
        kinds = [kind for kind in ("slope", "step", "file") if getattr(drive, kind) is not None]
        if len(kinds) != 1:
            raise RoverFileError(
                f"drives[{k}]: a drive has one of slope (rad), step (m) and file; this one has "
                f"{', '.join(kinds) or 'none'}"
            )


def _find_parameters(
    entries: Sequence[ParameterEntry], rover: Rover
) -> tuple[StudyParameter, ...]:
    """Return the parameters with their keys in the rover file; check that none is varied twice."""
    contents, found, taken = rover_to_dict(rover), [], set[Key]()
    for k, entry in enumerate(entries):
        at = f"parameters[{k}]"
        if not entry.low < entry.high:
            raise refuse(f"{at}.to", entry.high, f"above from, {entry.low:g}")
        numbers = [find_key(contents, name) for name in (entry.name, *entry.also)]
        keys, (unit, *others) = zip(*numbers, strict=True)
        if {*others} - {unit}:
            raise refuse(f"{at}.also", entry.also, f"names of numbers in {unit or 'no unit'}")
        if taken & {*keys}:
            raise refuse(f"{at}.name", entry.name, "a number that no other parameter varies")
        taken |= {*keys}
        now = get_value(contents, keys[0])
        found.append(StudyParameter(**vars(entry), keys=keys, unit=unit, now=now))
    return tuple(found)


def _beside(name: str, folder: Path) -> str:
    """Return the path of a file in a folder if it exists, else the name."""
    return str(folder / name) if os.path.isfile(folder / name) else name
