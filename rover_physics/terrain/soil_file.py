# SPDX-License-Identifier: Apache-2.0
"""Soils: parameters, presets and their file."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType
from typing import Annotated, Any, get_type_hints

from rover_physics.errors import RoverFileError, SoilError
from rover_physics.files.config_files import find_config
from rover_physics.files.rules import Keys, Text, choice, number
from rover_physics.files.validation import describe, errors_of, read_as, refuse, show_key, suggest
from rover_physics.files.yaml_file import read_yaml

COULOMB_MODEL, BEKKER_WONG_MODEL = "coulomb", "bekker_wong"
MODELS = (COULOMB_MODEL, BEKKER_WONG_MODEL)
"""Names of the soil models in a file."""
MAX_EXPONENT = 2.0
"""Largest sinkage exponent: published values are 0.1 to 1.6, the formula is singular at 3."""


@dataclass(frozen=True)
class Soil:
    """Parameters of a soil; those that its model does not use are NaN."""

    name: str
    """Name of the soil, its key in a file."""
    model: Annotated[str, choice(*MODELS)]
    """``"coulomb"`` or ``"bekker_wong"``."""
    source: Text
    """Source of the values."""
    friction: Annotated[float, number("", above=0.0)] = math.nan
    """Coulomb coefficient; NaN for that of the terrain or the rover."""
    cohesion: Annotated[float, number("Pa", least=0.0)] = math.nan
    """Cohesion c in [Pa]."""
    friction_angle: Annotated[float, number("rad", least=0.0, most=1.2)] = math.nan
    """Angle of internal shearing resistance phi in [rad]."""
    k_c: Annotated[float, number("N/m^(n+1)", least=0.0)] = math.nan
    """Cohesive modulus of sinkage in [N/m^(n+1)]."""
    k_phi: Annotated[float, number("N/m^(n+2)", above=0.0)] = math.nan
    """Frictional modulus of sinkage in [N/m^(n+2)]."""
    n: Annotated[float, number("", above=0.0, most=MAX_EXPONENT)] = math.nan
    """Exponent of sinkage."""
    shear_modulus: Annotated[float, number("m", above=0.0)] = math.nan
    """Shear displacement modulus K in [m]."""


@cache
def load_soils() -> Mapping[str, Soil]:
    """Return the preset soils by name, in the order of ``config/soils.yaml``.

    Raises:
        SoilError: Unreadable file, or a soil with a missing, unknown or invalid key.
    """
    place = find_config("soils.yaml")
    try:
        return MappingProxyType(soils_from_dict(read_yaml(place), str(place)))
    except RoverFileError as error:
        raise SoilError(str(error)) from error


def soils_from_dict(data: object, source: str) -> dict[str, Soil]:
    """Build soils from the contents of a soil file.

    Args:
        data: A mapping of names to mappings with the keys of a soil (docs/soil.md), SI units.
        source: File name or other origin, at the start of every error text.

    Raises:
        SoilError: Not such a mapping, or a missing, unknown or invalid key; the text names soil
            and key.
    """
    with errors_of(source, SoilError):
        if not isinstance(data, dict) or not data:
            raise RoverFileError(f"is {describe(data)}; it must be a mapping of names to soils")
        return {name: _read_soil(name, entry) for name, entry in data.items()}


def soil_named(name: str) -> Soil:
    """Return the preset soil of a name such as ``"dry_sand"``.

    Raises:
        SoilError: No soil of that name; the text lists the names.
    """
    known = load_soils()
    if name in known:
        return known[name]
    hint = suggest(str(name), tuple(known))
    raise SoilError(f"no soil {describe(name)}; {hint}soils are {', '.join(known)}")


def _read_soil(name: object, entry: object) -> Soil:
    if not isinstance(name, str) or not name.strip():
        raise RoverFileError(f"soil name is {describe(name)}; it must be a text")
    model = entry.get("model") if isinstance(entry, dict) else None
    kind = _keys_of(model if model in MODELS else "")
    soil = Soil(name, **read_as(kind, entry, "a soil", (name,)))
    if soil.cohesion == 0.0 and soil.friction_angle == 0.0:
        must = "above 0 where friction_angle is 0: a soil has some strength"
        raise refuse(show_key((name, "cohesion")), soil.cohesion, must)
    return soil


@cache
def _keys_of(model: str) -> Any:
    """Return the type of a soil's entry in a file; for an unknown model, one with all keys."""
    kinds = get_type_hints(Soil, include_extras=True)
    del kinds["name"]
    common = {key: kinds.pop(key) for key in ("model", "source")}
    coulomb = {"friction": kinds.pop("friction")}
    keys = {COULOMB_MODEL: Keys(common, coulomb), BEKKER_WONG_MODEL: Keys(common | kinds)}
    return Annotated[dict, keys.get(model, Keys(common, coulomb | kinds))]
