# SPDX-License-Identifier: Apache-2.0
"""The house: no circle of imports, and they run one way between rooms."""

from collections.abc import Iterator
from functools import lru_cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

from support.project.checkout import TOP, imported_names

PACKAGES = ("rover_physics", "msg_adapters", "rover_planner")


@lru_cache
def modules() -> dict[str, Path]:
    """Return all modules of the packages by their dotted names."""
    found = {}
    for package in PACKAGES:
        for path in sorted((TOP / package).rglob("*.py")):
            parts = path.relative_to(TOP).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imported_by(path: Path) -> Iterator[str]:
    """Yield the modules of the packages that a file imports."""
    for name in imported_names(path):
        while name and name not in modules():
            name = name.rpartition(".")[0]
        if name:
            yield name


@lru_cache
def imports() -> dict[str, frozenset[str]]:
    """Return what each module imports; the façade of a package names what it holds as text."""
    return {
        name: frozenset(imported_by(path)) - {name}
        for name, path in modules().items()
        if path.name != "__init__.py"
    }


def room_of(module: str) -> str:
    """Return the folder a module is in; a file at the top of a package is a room of its own."""
    return module if module.count(".") < 2 else module.rpartition(".")[0]


def assert_no_circle(arrows: dict[str, set[str]]) -> None:
    """Fail with the names along a circle, if there is one."""
    try:
        TopologicalSorter(arrows).prepare()
    except CycleError as circle:
        raise AssertionError(" <- ".join(circle.args[1])) from None


def test_no_circle_of_imports_between_modules():
    assert_no_circle({name: set(others) for name, others in imports().items()})


def test_imports_run_one_way_between_rooms():
    arrows: dict[str, set[str]] = {}
    for name, others in imports().items():
        beyond = {room_of(other) for other in others} - {room_of(name)}
        arrows.setdefault(room_of(name), set()).update(beyond)
    assert_no_circle(arrows)
