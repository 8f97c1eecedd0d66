"""Makes docs/parameters.md from the tables."""

from collections.abc import Iterable

from rover_planner.parameters.of_rover_simulator import ROVER_SIMULATOR
from rover_planner.parameters.of_traction_controller import TRACTION_CONTROLLER
from rover_planner.parameters.of_traverse_server import TRAVERSE_SERVER
from rover_planner.parameters.spec import ParameterSpec


def parameters_document() -> str:
    """Return the text of docs/parameters.md."""
    return "\n".join(
        [
            "# Parameters",
            "",
            "Made from the tables in `rover_planner/parameters/` by",
            "`python -m rover_planner.parameters > docs/parameters.md`; "
            "a test holds them together.",
            "",
            "## /traverse_server",
            "",
            *_table(TRAVERSE_SERVER),
            "",
            "## /traction_controller",
            "",
            *_table(TRACTION_CONTROLLER),
            "",
            "## /rover_simulator",
            "",
            *_table(ROVER_SIMULATOR),
            "",
            "Read-only parameters are set at start, the others at any time "
            "(`ros2 param set /traverse_server friction 0.6`).",
            "A value of the wrong type, NaN, out of bounds or not among the choices "
            "is refused with the reason.",
            "",
        ]
    )


def _table(specs: Iterable[ParameterSpec]) -> list[str]:
    """Return the lines of a Markdown table of parameters."""
    lines = ["| name | type | default | allowed | meaning |", "|---|---|---|---|---|"]
    for spec in specs:
        default = f"`{spec.default}`" if spec.default != "" else "empty"
        name = f"`{spec.name}`" + (" (read-only)" if spec.read_only else "")
        lines.append(f"| {name} | {spec.type_name} | {default} | {_allowed(spec)} | {spec.doc} |")
    return lines


def _allowed(spec: ParameterSpec) -> str:
    """Return the bounds with their unit, or the choices."""
    if spec.bounds is not None:
        return f"{spec.bounds[0]:g} to {spec.bounds[1]:g} {spec.unit}".rstrip()
    return ", ".join(f"`{choice}`" for choice in spec.choices) or "any"
