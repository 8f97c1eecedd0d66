# SPDX-License-Identifier: Apache-2.0
"""A link that holds what the page shows: rover, changed numbers, ends, path, time and colours."""

import base64
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from urllib.parse import parse_qsl, urlencode

import numpy as np

from rover_physics.files.validation import describe
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import rover_to_dict
from rover_physics.terrain.grid import Terrain
from rover_planner.errors import PlanningError
from rover_planner.studies.rover_values import get_value, list_values, with_value
from rover_planner.viewer.state.scenario import Pose

VALUE, JOINT = "rover.", "arm."
"""Prefixes of the keys of changed numbers and of the arm's joints."""
MAX_LENGTH = 8000
"""Most characters of a link; servers accept hardly more."""
MAX_TEXT = 200_000
"""Most bytes of a rover file that are unpacked; a few letters can hold far more."""
HALF_TURN = 180.0
"""Largest heading of a layer, both ways [deg]."""


@dataclass(frozen=True)
class PageLink:
    """Content of a link to the page."""

    rover: str
    """Name of the rover as it was loaded."""
    ground: str
    """Fingerprint of the map, by `fingerprint`."""
    start: Pose
    """x, y [m] and yaw [rad], map frame."""
    goal: Pose
    """The same."""
    policy: str
    """Torque policy."""
    soil: str
    """Preset soil; empty for none."""
    path: int
    """Number of the shown path, from 1."""
    time: float
    """Time of the drive [s]."""
    layer: str
    """Name of the layer that colours the ground."""
    heading: float
    """Heading of the rover for predicted layers [deg]."""
    values: Mapping[str, float] = field(default_factory=dict)
    """Changed numbers of the rover by label."""
    joints: Mapping[str, float] = field(default_factory=dict)
    """Angles of the arm's joints by name [rad]."""
    along: bool = False
    """True if predicted layers are for the heading of the path, not for `heading`."""
    rover_file: str = ""
    """Text of the file of the rover as it was loaded; empty for a preset."""


def fingerprint(terrain: Terrain) -> str:
    """Return a short text that another map hardly has."""
    head = np.array([*terrain.origin, terrain.resolution, *terrain.elevation.shape])
    heights = np.ascontiguousarray(terrain.elevation)
    return f"{zlib.crc32(heights.tobytes(), zlib.crc32(head.tobytes())):08x}"


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
    """Return a link as the query of an address.

    Raises:
        PlanningError: It would have more than MAX_LENGTH characters.
    """
    words = {
        "rover": link.rover,
        "map": link.ground,
        "start": _join(link.start),
        "goal": _join(link.goal),
        "torques": link.policy,
        "soil": link.soil,
        "path": str(link.path),
        "time": _number(link.time),
        "layer": link.layer,
        "heading": _number(link.heading),
    }
    words |= {f"{VALUE}{label}": _number(number) for label, number in link.values.items()}
    words |= {f"{JOINT}{joint}": _number(angle) for joint, angle in link.joints.items()}
    words |= {"along": "1"} if link.along else {}
    words |= {"rover_file": pack_text(link.rover_file)} if link.rover_file else {}
    query = urlencode(words)
    if len(query) >= MAX_LENGTH:
        raise PlanningError(
            f"the link would have {len(query)} characters with the file of {link.rover}; an "
            f"address holds {MAX_LENGTH}. Save the rover file and the HTML file instead"
        )
    return query


def read_link(query: str) -> PageLink | None:
    """Return what the query of an address holds; None if it is not one of `write_link`.

    Raises:
        PlanningError: A value is missing or invalid; the text names it.
    """
    words = dict(parse_qsl(query[:MAX_LENGTH].removeprefix("?"), keep_blank_values=True))
    if "rover" not in words or "map" not in words:
        return None
    missing = [name for name in ("start", "goal", "torques", "layer") if name not in words]
    if missing:
        raise PlanningError(f"the link has no {missing[0]}")
    return PageLink(
        rover=words["rover"],
        ground=words["map"],
        start=_read_pose("start", words["start"]),
        goal=_read_pose("goal", words["goal"]),
        policy=words["torques"],
        soil=words.get("soil", ""),
        path=_read_path(words.get("path", "1")),
        time=_read("time", words.get("time", "0")),
        layer=words["layer"],
        heading=_read_heading(words.get("heading", "0")),
        values=_read_all(VALUE, words),
        joints=_read_all(JOINT, words),
        along=words.get("along") == "1",
        rover_file=unpack_text(words["rover_file"]) if "rover_file" in words else "",
    )


def _read_all(prefix: str, words: Mapping[str, str]) -> dict[str, float]:
    return {
        name.removeprefix(prefix): _read(name, text)
        for name, text in words.items()
        if name.startswith(prefix)
    }


def _read(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise PlanningError(f"{name} of the link is {describe(text)}; it must be a number")
    return value


def _read_path(text: str) -> int:
    number = _read("path", text)
    if number < 1.0 or number != int(number):
        raise PlanningError(f"path of the link is {describe(text)}; it must be 1, 2, 3, ...")
    return int(number)


def _read_heading(text: str) -> float:
    heading = _read("heading", text)
    if abs(heading) > HALF_TURN:
        raise PlanningError(
            f"heading of the link is {describe(text)}; it must be -{HALF_TURN:g} to "
            f"{HALF_TURN:g} deg"
        )
    return heading


def _read_pose(name: str, text: str) -> Pose:
    parts = [_read(name, part) for part in text.split(",")]
    if len(parts) != 3:
        raise PlanningError(f"{name} of the link is {describe(text)}; it must be x,y,yaw")
    return parts[0], parts[1], parts[2]


def _join(pose: Pose) -> str:
    return ",".join(map(_number, pose))


def _number(value: float) -> str:
    """Return a number in the fewest digits that give it back; a plus sign would be lost."""
    return repr(float(value)).replace("e+", "e")


def pack_text(text: str) -> str:
    """Return a text in letters that an address may hold, compressed."""
    return base64.urlsafe_b64encode(zlib.compress(text.encode(), 9)).decode().rstrip("=")


def unpack_text(packed: str) -> str:
    """Return the text that `pack_text` has packed.

    Raises:
        PlanningError: It is damaged, or larger than MAX_TEXT.
    """
    unpacker = zlib.decompressobj()
    try:
        data = base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4))
        text = unpacker.decompress(data, MAX_TEXT).decode()
    except (ValueError, zlib.error) as error:
        raise PlanningError(f"the rover file in the link is damaged ({error})") from error
    if not unpacker.eof:
        raise PlanningError(
            f"the rover file in the link is cut off, or larger than {MAX_TEXT} bytes"
        )
    return text
