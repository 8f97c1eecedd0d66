# SPDX-License-Identifier: Apache-2.0
"""A link that holds what the page shows: rover, changed numbers, ends, path, time and colours."""

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated
from urllib.parse import parse_qs

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_to_dict
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import get_value, list_values, with_value
from rover_planner.viewer.state.scenario import Pose

KEY = "view"
"""Key of a link in the query of an address."""
MAX_LENGTH = 8000
"""Most characters of a link; servers accept hardly more."""
MAX_TEXT = 200_000
"""Most bytes that are unpacked; a few letters can hold far more."""


@dataclass(frozen=True)
class PageLink:
    """Content of a link to the page."""

    __pydantic_config__ = ConfigDict(allow_inf_nan=False, extra="forbid")

    rover: str
    """Name of the rover as it was loaded."""
    ground: str
    """Fingerprint of the map."""
    start: Pose
    """x, y [m] and yaw [rad], map frame."""
    goal: Pose
    """The same."""
    policy: str
    """Torque policy."""
    soil: str
    """Preset soil; empty for none."""
    path: Annotated[int, Field(ge=1)]
    """Number of the path that is looked at, from 1."""
    time: float
    """Time of the drive [s]."""
    layer: str
    """Name of the layer that colours the ground."""
    heading: Annotated[float, Field(ge=-180.0, le=180.0)]
    """Heading of the rover for predicted layers [deg]."""
    values: Mapping[str, float] = field(default_factory=dict)
    """Changed numbers of the rover by label."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Angles of the arm's joints by name [rad]."""
    along: bool = False
    """True if predicted layers are for the heading of the path, not for `heading`."""
    rover_file: str = ""
    """Text of the file of the rover as it was loaded; empty for a preset."""


LINK = TypeAdapter(PageLink)


def list_changed_values(loaded: Rover, rover: Rover) -> dict[str, float]:
    """Return the numbers, by label, in which a rover differs from the one that was loaded."""
    old, new, found = rover_to_dict(loaded), rover_to_dict(rover), {}
    for one in (value for part in list_values(loaded).values() for value in part):
        was, now = (get_value(data, one.keys[0]) for data in (old, new))
        if abs(was - now) > 1e-9:
            found[one.label] = now
    return found


def change_values(loaded: Rover, values: Mapping[str, float]) -> Rover:
    """Return a rover with changed numbers, by label.

    Raises:
        PlanningError: There is no such number.
        RoverError: The changed rover is invalid.
    """
    known = {value.label: value for part in list_values(loaded).values() for value in part}
    rover = loaded
    for label, number in values.items():
        if label not in known:
            raise PlanningError(f"the link changes {label!r}, which {loaded.name} does not have")
        rover = with_value(rover, known[label].keys, number)
    return rover


def write_link(link: PageLink) -> str:
    """Return a link as the query of an address: compressed JSON in letters that it may hold.

    Raises:
        PlanningError: It would have more than MAX_LENGTH characters.
    """
    packed = base64.urlsafe_b64encode(zlib.compress(LINK.dump_json(link), 9))
    query = f"{KEY}={packed.decode().rstrip('=')}"
    if len(query) >= MAX_LENGTH:
        raise PlanningError(
            f"the link would have {len(query)} characters with the file of {link.rover}; an "
            f"address holds {MAX_LENGTH}. Save the rover file and the HTML file instead"
        )
    return query


def read_link(query: str) -> PageLink | None:
    """Return what the query of an address holds; None if it is not one of `write_link`.

    Raises:
        PlanningError: It is damaged, or a value is missing or invalid; the text names it.
    """
    packed = parse_qs(query[:MAX_LENGTH].removeprefix("?")).get(KEY, [""])[0]
    if not packed:
        return None
    unpacker = zlib.decompressobj()
    try:
        data = base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4))
        text = unpacker.decompress(data, MAX_TEXT)
    except (ValueError, zlib.error) as error:
        raise PlanningError(f"the link is damaged ({error})") from error
    if not unpacker.eof:
        raise PlanningError(f"the link is cut off, or holds more than {MAX_TEXT} bytes")
    try:
        return LINK.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(map(str, first["loc"])) or "it"
        raise PlanningError(f"the link is invalid: {where}: {first['msg']}") from None
