# SPDX-License-Identifier: Apache-2.0
"""Poses and places on the command line, with commas or blanks between their numbers."""

import math
import re
from collections.abc import Sequence
from typing import Any, NamedTuple

import typer
from typer.core import TyperCommand

SIZES = {"--start": 3, "--goal": 3, "--from": 2}
"""Count of numbers behind each option that takes a pose or a place."""
BETWEEN = re.compile(r"\s*,\s*|\s+")
"""Separator of two numbers."""


class Pose(NamedTuple):
    """A pose of the body in the map frame."""

    x: float
    """In [m]."""
    y: float
    """In [m]."""
    yaw: float
    """In [rad]."""


def read_numbers(text: str, count: int) -> tuple[float, ...] | None:
    """Return the finite numbers of a text with commas or blanks; None if it is not `count`."""
    try:
        numbers = tuple(float(part) for part in BETWEEN.split(text.strip()))
    except ValueError:
        return None
    return numbers if len(numbers) == count and all(map(math.isfinite, numbers)) else None


def read_pose(text: str) -> Pose:
    """Read a pose from the text X,Y,YAW or X Y YAW, in m and rad.

    Raises:
        typer.BadParameter: Not three finite numbers.
    """
    numbers = read_numbers(text, len(Pose._fields))
    if numbers is None:
        raise typer.BadParameter(
            f"{text!r} is no pose; it must be X,Y,YAW or X Y YAW in m and rad"
        )
    return Pose(*numbers)


def pose_option(help: str) -> Any:
    """Return an option of typer that takes a pose."""
    return typer.Option(parser=read_pose, metavar="X,Y,YAW", help=help)


START = pose_option("Start of the body in m and rad, map frame.")
GOAL = pose_option("Goal of the body in m and rad, map frame.")


class PoseCommand(TyperCommand):
    """A command whose poses may be one word, X,Y,YAW, or three, X Y YAW; numbers may be negative.

    An option of the parser takes always as many words. So that both forms fit, the words of a pose
    become one before they are parsed.
    """

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of the command line."""
        return super().parse_args(ctx, join_poses(args))


class PlacesCommand(TyperCommand):
    """A command whose arguments are numbers, each a word, or several with commas in one."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of the command line."""
        return super().parse_args(ctx, split_numbers(args))


def join_poses(words: Sequence[str]) -> list[str]:
    """Return words with each option of SIZES and its numbers as one, such as --start=1,0,0."""
    joined: list[str] = []
    k = 0
    while k < len(words):
        name, equals, first = words[k].partition("=")
        k += 1
        if name == "--":
            return [*joined, *words[k - 1 :]]
        if name not in SIZES:
            joined.append(words[k - 1])
            continue
        parts = BETWEEN.split(first.strip()) if equals else []
        while k < len(words) and len(parts) < SIZES[name] and (more := _numbers_in(words[k])):
            parts += more
            k += 1
        joined.append(f"{name}={','.join(parts)}" if parts else name)
    return joined


def split_numbers(words: Sequence[str]) -> list[str]:
    """Return words with each list of numbers with commas as one word for each number."""
    return [part for word in words for part in _numbers_in(word) or [word]]


def _numbers_in(word: str) -> list[str]:
    """Return the numbers of a word, with commas or blanks between them; none if it has others."""
    parts = BETWEEN.split(word.strip(" ,"))
    try:
        return parts if [float(part) for part in parts] else []
    except ValueError:
        return []
