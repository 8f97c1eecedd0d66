"""The rooms of the viewer import one way: state, browser, then scene, panel, live, then pages."""

import ast
from pathlib import Path

import pytest

import rover_planner.viewer

FOLDER = Path(rover_planner.viewer.__file__).parent
ALLOWED = {
    "state": {"state"},
    "browser": {"state", "browser"},
    "scene": {"state", "browser", "scene"},
    "panel": {"state", "panel"},
    "live": {"state", "live"},
    "pages": {"state", "scene", "panel", "live", "browser", "pages"},
}
"""The rooms that the files of each room may import."""


def imported_rooms(file: Path) -> set[str]:
    """Return the rooms of the viewer that a file imports."""
    nodes = ast.walk(ast.parse(file.read_text()))
    modules = [node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module]
    prefix = "rover_planner.viewer."
    return {name.removeprefix(prefix).split(".")[0] for name in modules if name.startswith(prefix)}


def test_every_room_of_the_viewer_has_a_rule():
    rooms = {file.parent.name for file in FOLDER.glob("*/*.py")}
    assert rooms == set(ALLOWED)


@pytest.mark.parametrize("room", ALLOWED)
def test_a_room_imports_only_rooms_below_it(room):
    files = sorted((FOLDER / room).glob("*.py"))
    wrong = {file.name: imported_rooms(file) - ALLOWED[room] for file in files}
    assert {name: rooms for name, rooms in wrong.items() if rooms} == {}
