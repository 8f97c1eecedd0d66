"""What a study file says: a rover, its numbers that vary, what is driven, and what is best."""

from dataclasses import dataclass
from pathlib import Path

from rover_physics.config_section import ConfigSection
from rover_physics.errors import RoverFileError
from rover_physics.rover import Rover, load_rover
from rover_physics.yaml_file import read_yaml
from rover_planner.studies.rover_keys import Key, find_key
from rover_planner.viewer.rover_values import rover_to_dict

OBJECTIVES = {
    "worst_utilisation": ("smallest", "largest friction utilisation on the drives", ""),
    "tip_over_margin": ("largest", "smallest stability margin on the drives", ""),
    "tallest_step": ("largest", "tallest step climbed", "m"),
    "load_imbalance": ("smallest", "largest wheel load over the mean, level ground", ""),
}
"""Objectives by name: what is best, what it is, its unit."""
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
    return study_from_dict(read_yaml(path), str(path))


def study_from_dict(data: object, source: str) -> Study:
    """Build a study from the contents of a study file; `source` opens every error text."""
    optional = ("method", "policy", "friction", "evaluations", "drives")
    top = ConfigSection(data, source, "", ("rover", "objective", "parameters"), optional)
    rover = load_rover(top.text("rover"))
    objective = top.choice("objective", tuple(OBJECTIVES))
    drives = tuple(_read_drives(top)) if top.has("drives") else ()
    needs_drives = objective in ("worst_utilisation", "tip_over_margin")
    if needs_drives and not drives:
        raise RoverFileError(
            f"{source}: drives is missing; the objective {objective} is about what is driven"
        )
    return Study(
        rover=rover,
        objective=objective,
        method=top.choice("method", METHODS) if top.has("method") else "sweep",
        policy=top.choice("policy", POLICIES) if top.has("policy") else "equal",
        friction=top.number("friction", "", above=0.0) if top.has("friction") else None,
        evaluations=(
            int(top.number("evaluations", "", least=3, most=1e5)) if top.has("evaluations") else 60
        ),
        parameters=tuple(_read_parameters(top, rover, source)),
        drives=drives,
    )


def _read_parameters(top: ConfigSection, rover: Rover, source: str):
    contents = rover_to_dict(rover)
    for section in top.sections("parameters", ("name", "from", "to"), ("count",)):
        name = section.text("name")
        key, unit = find_key(contents, name, source)
        low, high = section.number("from", unit), section.number("to", unit)
        if not low < high:
            raise section.error("to", f"above from, {low:g}")
        count = (
            int(section.number("count", "", least=2, most=1000)) if section.has("count") else 11
        )
        yield StudyParameter(name, key, unit, low, high, count)


def _read_drives(top: ConfigSection):
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
            file=section.text("file") if kind == "file" else "",
            start=(start[0], start[1], start[2]),
            length=section.number("length", "m", above=0.0) if section.has("length") else 2.0,
        )
