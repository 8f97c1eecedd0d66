"""What a study file says: a rover, its numbers that vary, what is driven, and what is best."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rover_physics.errors import RoverFileError
from rover_physics.files.config_section import ConfigSection
from rover_physics.files.yaml_file import read_yaml
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.soil_file import soil_named
from rover_planner.studies.rover_keys import Key, find_key
from rover_planner.studies.rover_values import get_value, rover_to_dict

OBJECTIVES = {
    "worst_utilisation": ("smallest", "largest friction utilisation on the drives", ""),
    "tip_over_margin": ("largest", "smallest tip-over angle on the drives", "rad"),
    "drive_energy": ("smallest", "largest energy of a metre of the drives", "J/m"),
    "tallest_step": ("largest", "tallest step climbed", "m"),
    "load_imbalance": ("smallest", "largest wheel load over the mean, level ground", ""),
}
"""Objectives by name: what is best, what it is, its unit."""
ABOUT_DRIVES = ("worst_utilisation", "tip_over_margin", "drive_energy")
"""Objectives that need drives."""
METHODS = ("sweep", "optimise")
POLICIES = ("equal", "optimal")


@dataclass(frozen=True)
class StudyParameter:
    """A number of the rover that varies."""

    name: str
    """As it is written, such as suspension.bogie_pivot.z."""
    key: Key
    """Where it is in the rover file."""
    unit: str
    """Its unit."""
    low: float
    """Smallest value."""
    high: float
    """Largest value."""
    count: int
    """Values of a sweep, the ends included."""
    also: tuple[Key, ...] = ()
    """Further numbers that always have the same value."""
    now: float = float("nan")
    """What the rover file has."""


@dataclass(frozen=True)
class StudyDrive:
    """What is driven over, straight along a line."""

    kind: str
    """slope, step or file."""
    size: float
    """Angle of the slope [rad] or height of the step [m]."""
    file: str
    """Terrain file, empty for the others."""
    start: tuple[float, float, float]
    """x, y [m] and yaw [rad]."""
    length: float
    """[m]"""


@dataclass(frozen=True)
class Study:
    """One study."""

    rover: Rover
    """The rover whose numbers vary."""
    objective: str
    """One of OBJECTIVES."""
    method: str
    """One of METHODS."""
    policy: str
    """How the wheels share the traction."""
    friction: float | None
    """Instead of the rover's own."""
    soil: str | None
    """Preset soil of the ground; None: firm ground."""
    evaluations: int
    """Most evaluations of an optimisation."""
    parameters: tuple[StudyParameter, ...]
    """What varies; of a sweep all combinations are tried."""
    drives: tuple[StudyDrive, ...]
    """What is driven, for objectives that need it."""

    @property
    def wants_largest(self) -> bool:
        """Whether more of the objective is better."""
        return OBJECTIVES[self.objective][0] == "largest"


def load_study(path: Path) -> Study:
    """Read a study file; docs/studies.md has its keys.

    Raises:
        RoverFileError: The file cannot be read, or a key is missing, unknown or impossible.
    """
    if not path.is_file():
        raise RoverFileError(f"no study file {path}")
    return study_from_dict(read_yaml(path), str(path), path.parent)


def study_from_dict(data: object, source: str, folder: Path = Path()) -> Study:
    """Build a study from the contents of a study file.

    Args:
        data: Nested mapping with the keys of a study file (docs/studies.md).
        source: Opens every error text.
        folder: Where rover and terrain files are looked for first.

    Raises:
        RoverFileError: A key is missing, unknown or impossible; names it.
        SoilError: A soil that is not among the presets.
    """
    optional = ("method", "policy", "friction", "soil", "evaluations", "drives")
    required = ("rover", "objective", "parameters")
    top = ConfigSection(data, source, "", required, optional, kind="a study file")
    rover = load_rover(_beside(top.text("rover"), folder))
    objective = top.choice("objective", tuple(OBJECTIVES))
    drives = tuple(_read_drives(top, folder)) if top.has("drives") else ()
    if objective in ABOUT_DRIVES and not drives:
        raise RoverFileError(
            f"{source}: drives is missing; the objective {objective} is about what is driven"
        )
    for key in ("drives", "soil"):
        if objective not in ABOUT_DRIVES and top.has(key):
            raise top.error(key, f"left out: the objective {objective} does not use it")
    return Study(
        rover=rover,
        objective=objective,
        method=top.choice("method", METHODS) if top.has("method") else "sweep",
        policy=top.choice("policy", POLICIES) if top.has("policy") else "equal",
        friction=top.number("friction", "", above=0.0) if top.has("friction") else None,
        soil=soil_named(top.text("soil")).name if top.has("soil") else None,
        evaluations=_whole(top, "evaluations", 3, 100_000, 60),
        parameters=tuple(_read_parameters(top, rover, source)),
        drives=drives,
    )


def _whole(section: ConfigSection, name: str, least: int, most: int, default: int) -> int:
    """Return a whole number, the default where the key is not there."""
    if not section.has(name):
        return default
    value = section.number(name, "", least=least, most=most)
    if not value.is_integer():
        raise section.error(name, f"a whole number from {least} to {most}")
    return int(value)


def _read_parameters(top: ConfigSection, rover: Rover, source: str):
    contents = rover_to_dict(rover)
    taken: set[Key] = set()
    for section in top.sections("parameters", ("name", "from", "to"), ("count", "also")):
        name = section.text("name")
        key, unit = find_key(contents, name, source)
        low, high = section.number("from", unit), section.number("to", unit)
        if not low < high:
            raise section.error("to", f"above from, {low:g}")
        count = _whole(section, "count", 2, 1000, 11)
        also = tuple(_read_also(section, contents, source, unit))
        if taken & {key, *also}:
            raise section.error("name", "a number that no other parameter varies")
        taken |= {key, *also}
        now = get_value(contents, key)
        yield StudyParameter(name, key, unit, low, high, count, also, now)


def _read_also(section: ConfigSection, contents: dict[str, Any], source: str, unit: str):
    """Yield the keys of numbers that go along with a parameter."""
    for name in section.names("also") if section.has("also") else ():
        key, own_unit = find_key(contents, name, source)
        if own_unit != unit:
            raise section.error("also", f"names of numbers in {unit or 'no unit'}")
        yield key


def _beside(name: str, folder: Path) -> str:
    """Return the file of that name in a folder, or the name where there is none."""
    return str(folder / name) if (folder / name).is_file() else name


def _read_drives(top: ConfigSection, folder: Path):
    optional = ("slope", "step", "file", "start", "length")
    for section in top.sections("drives", (), optional):
        kinds = [kind for kind in ("slope", "step", "file") if section.has(kind)]
        if len(kinds) != 1:
            raise RoverFileError(
                f"{section.key('drives')}: a drive has one of slope (rad), step (m) and file; "
                f"this one has {', '.join(kinds) or 'none'}"
            )
        kind = kinds[0]
        start = section.numbers("start", 3, "m, m, rad") if section.has("start") else (0.0,) * 3
        yield StudyDrive(
            kind=kind,
            size=section.number(kind, "rad" if kind == "slope" else "m")
            if kind != "file"
            else 0.0,
            file=_beside(section.text("file"), folder) if kind == "file" else "",
            start=(start[0], start[1], start[2]),
            length=section.number("length", "m", above=0.0) if section.has("length") else 2.0,
        )
