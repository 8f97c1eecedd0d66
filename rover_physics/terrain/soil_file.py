"""Soils: their parameters, the presets, and how they are read from a file."""

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rover_physics.errors import RoverFileError, SoilError
from rover_physics.files.config_files import find_config
from rover_physics.files.config_section import ConfigSection, describe
from rover_physics.files.yaml_file import read_yaml

COULOMB_MODEL, BEKKER_WONG_MODEL = "coulomb", "bekker_wong"
MODELS = (COULOMB_MODEL, BEKKER_WONG_MODEL)
MAX_EXPONENT = 2.0
"""Sinkage exponents are published from 0.1 to 1.6; the wheel formula breaks down at 3."""

_BEKKER_WONG_KEYS = ("cohesion", "friction_angle", "k_c", "k_phi", "n", "shear_modulus")


@dataclass(frozen=True)
class Soil:
    """What a wheel-soil model needs to know of a soil; NaN where its model has no use for it."""

    name: str
    """What the soil is called."""
    model: str
    """``"coulomb"`` or ``"bekker_wong"``."""
    source: str
    """Where the values come from."""
    friction: float = math.nan
    """Coulomb coefficient; NaN where the terrain's or the rover's own holds."""
    cohesion: float = math.nan
    """Cohesion c in [Pa]."""
    friction_angle: float = math.nan
    """Angle of internal shearing resistance phi in [rad]."""
    k_c: float = math.nan
    """Cohesive modulus of sinkage in [N/m^(n+1)]."""
    k_phi: float = math.nan
    """Frictional modulus of sinkage in [N/m^(n+2)]."""
    n: float = math.nan
    """Exponent of sinkage."""
    shear_modulus: float = math.nan
    """Shear displacement modulus K in [m]."""


def load_soils(path: str | Path | None = None) -> dict[str, Soil]:
    """Load the soils of a file, or the presets.

    Args:
        path: A YAML file with the keys of ``config/soils.yaml``; None for that file itself.

    Returns:
        Soils by name, in the order of the file.

    Raises:
        SoilError: Unreadable file, or a soil with a missing, unknown or impossible key.
    """
    place = find_config("soils.yaml") if path is None else Path(path)
    try:
        return soils_from_dict(read_yaml(place), str(place))
    except RoverFileError as error:
        raise SoilError(str(error)) from error


def soils_from_dict(data: object, source: str) -> dict[str, Soil]:
    """Build soils from the contents of a soil file.

    Args:
        data: A mapping of names to mappings with the keys of a soil (docs/soil.md), SI units.
        source: File name or other origin, opens every error text.

    Raises:
        SoilError: Not such a mapping, or a missing, unknown or impossible key; names soil and key.
    """
    if not isinstance(data, Mapping) or not data:
        raise SoilError(f"{source}: is {describe(data)}; it must be a mapping of names to soils")
    soils = {}
    for name, entry in data.items():
        if not isinstance(name, str) or not name.strip():
            raise SoilError(f"{source}: soil name is {describe(name)}; it must be a text")
        try:
            soils[name] = _read_soil(name, entry, source)
        except RoverFileError as error:
            raise SoilError(str(error)) from None
    return soils


def soil_named(name: str, soils: Mapping[str, Soil] | None = None) -> Soil:
    """Return one soil.

    Args:
        name: Its name, e.g. ``"dry_sand"``.
        soils: The soils to look in; None for the presets.

    Raises:
        SoilError: No soil of that name; lists those there are.
    """
    known = load_soils() if soils is None else soils
    if name in known:
        return known[name]
    close = difflib.get_close_matches(str(name), known, n=1)
    hint = f"did you mean {close[0]}? " if close else ""
    raise SoilError(f"no soil {name!r}; {hint}soils are {', '.join(known)}")


def _read_soil(name: str, entry: object, source: str) -> Soil:
    common = ("model", "source")
    every = ConfigSection(entry, source, name, common, ("friction", *_BEKKER_WONG_KEYS))
    text = every.text("source")
    if every.choice("model", MODELS) == COULOMB_MODEL:
        soil = ConfigSection(entry, source, name, common, ("friction",))
        has_own = soil.has("friction")
        friction = soil.number("friction", "", above=0.0) if has_own else math.nan
        return Soil(name, COULOMB_MODEL, text, friction)
    soil = ConfigSection(entry, source, name, (*common, *_BEKKER_WONG_KEYS))
    cohesion = soil.number("cohesion", "Pa", least=0.0)
    friction_angle = soil.number("friction_angle", "rad", least=0.0, most=1.2)
    if cohesion == 0.0 and friction_angle == 0.0:
        raise soil.error("cohesion", "above 0 where friction_angle is 0: a soil has some strength")
    return Soil(
        name,
        BEKKER_WONG_MODEL,
        text,
        cohesion=cohesion,
        friction_angle=friction_angle,
        k_c=soil.number("k_c", "N/m^(n+1)", least=0.0),
        k_phi=soil.number("k_phi", "N/m^(n+2)", above=0.0),
        n=soil.number("n", "", above=0.0, most=MAX_EXPONENT),
        shear_modulus=soil.number("shear_modulus", "m", above=0.0),
    )
