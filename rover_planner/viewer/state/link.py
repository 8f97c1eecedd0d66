# SPDX-License-Identifier: Apache-2.0
"""A link that holds what the page shows: rover, changed numbers, ends, path, time and colours."""

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any
from urllib.parse import parse_qs

from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from rover_planner.errors import PlanningError
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

    loaded: Mapping[str, Any]
    """Content of the file of the rover as it was loaded."""
    rover: Mapping[str, Any]
    """The same with its numbers as they were changed since."""
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
    joints: Mapping[str, float] = field(default_factory=dict)
    """Angles of the arm's joints by name [rad]."""
    along: bool = False
    """True if predicted layers are for the heading of the path, not for `heading`."""


LINK = TypeAdapter(PageLink)


def write_link(link: PageLink) -> str:
    """Return a link as the query of an address: compressed JSON in letters that it may hold.

    Raises:
        PlanningError: It would have more than MAX_LENGTH characters.
    """
    packed = base64.urlsafe_b64encode(zlib.compress(LINK.dump_json(link), 9))
    query = f"{KEY}={packed.decode().rstrip('=')}"
    if len(query) >= MAX_LENGTH:
        raise PlanningError(
            f"the link would have {len(query)} characters with the file of {link.rover['name']}; "
            f"an address holds {MAX_LENGTH}. Save the rover file and the HTML file instead"
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
