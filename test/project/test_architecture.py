# SPDX-License-Identifier: Apache-2.0
"""The house: no circle of imports, and they run one way between rooms."""

from collections.abc import Iterator
from functools import lru_cache
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


def find_circle(arrows: dict[str, set[str]]) -> list[str]:
    """Return nodes that form a circle, nothing where there is none."""
    done: set[str] = set()

    def visit(node: str, way: list[str]) -> list[str]:
        if node in way:
            return [*way[way.index(node) :], node]
        if node in done:
            return []
        for other in sorted(arrows.get(node, ())):
            circle = visit(other, [*way, node])
            if circle:
                return circle
        done.add(node)
        return []

    for node in sorted(arrows):
        circle = visit(node, [])
        if circle:
            return circle
    return []


def test_no_circle_of_imports_between_modules():
    circle = find_circle({name: set(others) for name, others in imports().items()})
    assert not circle, " -> ".join(circle)


def test_imports_run_one_way_between_rooms():
    arrows: dict[str, set[str]] = {}
    for name, others in imports().items():
        beyond = {room_of(other) for other in others} - {room_of(name)}
        arrows.setdefault(room_of(name), set()).update(beyond)
    circle = find_circle(arrows)
    assert not circle, " -> ".join(circle)


def test_a_circle_would_be_found():
    assert find_circle({"a": {"b"}, "b": {"c"}, "c": {"a"}}) == ["a", "b", "c", "a"]
    assert find_circle({"a": {"b", "c"}, "b": {"c"}}) == []
