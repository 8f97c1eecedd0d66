# SPDX-License-Identifier: Apache-2.0
"""The answers to a mission's goals as a table for the terminal."""

from typing import Any

from rich.markup import escape
from rich.table import Table
from rich.text import Text

from rover_physics.rover.model import Rover
from rover_planner.planning.goals import Mission

ANSWER_COLUMNS = (
    ("length\n[m]", "length", 2),
    ("time\n[s]", "time", 0),
    ("energy\n[J]", "energy", 1),
    ("smallest\ntip-over\nmargin", "min_tip_over_ratio", 2),
    ("highest\nfriction\nuse", "max_friction_utilisation", 2),
    ("highest\ntorque\nuse", "max_torque_saturation", 2),
    ("highest\nload [N]", "max_wheel_load", 1),
)
"""Columns of numbers: heading, key of the answer, digits after the point."""


def answer_table(rover: Rover, mission: Mission, answers: list[dict[str, Any]]) -> Table:
    """Return a table of the verdicts of a traverse_server, one row per goal.

    Args:
        rover: The rover.
        mission: The goals.
        answers: The verdict on each goal, as `MissionPlanner.ask` returns it.
    """
    table = Table(
        title=f"Answers of /traverse_server for {rover.name}",
        title_justify="left",
        row_styles=("", "dim"),
        expand=False,
    )
    for heading in ("goal", "verdict", "reason"):
        table.add_column(heading, overflow="fold")
    for heading, _, _ in ANSWER_COLUMNS:
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for goal, answer in zip(mission.goals, answers, strict=True):
        passable = answer["traversable"]
        table.add_row(
            f"{goal.name} {goal.intent}",
            Text("traversable", style="bold blue")
            if passable
            else Text("refused", style="bold red"),
            "" if passable else answer["reason"],
            *(_number(answer.get(key), digits) for _, key, digits in ANSWER_COLUMNS),
        )
    return table


def _number(value: float | None, digits: int) -> str:
    """Format a number; None becomes a dash."""
    return "-" if value is None else f"{value:.{digits}f}"
