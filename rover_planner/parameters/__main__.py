# SPDX-License-Identifier: Apache-2.0
"""Prints docs/parameters.md, which is made of the tables."""

from collections.abc import Iterator

from rover_planner.parameters.ground_learner import GroundLearnerParameters
from rover_planner.parameters.rover_simulator import RoverSimulatorParameters
from rover_planner.parameters.table import ParameterSpec, ParameterTable, specs_of
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.parameters.traverse_server import TraverseServerParameters

TABLES: dict[str, type[ParameterTable]] = {
    "/traverse_server": TraverseServerParameters,
    "/traction_controller": TractionControllerParameters,
    "/rover_simulator": RoverSimulatorParameters,
    "/ground_learner": GroundLearnerParameters,
}
"""Tables of the nodes, by name and in the order of the document."""


def parameters_document() -> str:
    """Return the text of docs/parameters.md."""
    return "\n".join(
        [
            "# Parameters",
            "",
            "Made by `python -m rover_planner.parameters > docs/parameters.md`. The default shows",
            "the type; an empty one is a string. `--help` of a node has the bounds, too.",
            "Parameters with \\* are set at start, the others at any time (`ros2 param set",
            "/traverse_server friction 0.6`). What is not allowed is refused with the reason.",
            "",
            *_sections(),
        ]
    )


def _sections() -> Iterator[str]:
    """Yield the lines of a Markdown table per node; it only names rows of an earlier table."""
    homes: dict[str, str] = {}
    for node, table in TABLES.items():
        rows = {spec.name: _row(spec) for spec in specs_of(table)}
        yield from (f"## {node}", "")
        yield from ("| name | default; other choices | meaning |", "|---|---|---|")
        yield from (row for row in rows.values() if row not in homes)
        yield ""
        for home in dict.fromkeys(homes.values()):
            same = [f"`{name}`" for name, row in rows.items() if homes.get(row) == home]
            if same:
                yield from (f"As for `{home}`: {', '.join(same)}.", "")
        homes |= {row: node for row in rows.values() if row not in homes}


def _row(spec: ParameterSpec) -> str:
    name = f"`{spec.name}`" + ("\\*" if spec.read_only else "")
    return f"| {name} | {_values(spec)} | {spec.meaning} |"


def _values(spec: ParameterSpec) -> str:
    """Return the default with its unit, then the other choices, as text."""
    default = f"`{spec.ros_default}` {spec.unit}".rstrip() if spec.default != "" else "empty"
    others = [f"`{choice}`" for choice in spec.choices if choice != spec.default]
    return "; ".join([default, ", ".join(others)]) if others else default


if __name__ == "__main__":
    print(parameters_document(), end="")
