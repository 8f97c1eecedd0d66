# SPDX-License-Identifier: Apache-2.0
"""The package: one version, entry points that exist, imports one way only, and its API."""

import ast
import importlib
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import rover_physics
from rover_planner.nodes.start import PROGRAMS
from rover_planner.shell.extras import PLAIN
from support.project.checkout import TOP, console_scripts, setup_arguments

ROS_FREE = {*PLAIN, "pydantic_core", "rover_physics"} - {"rich", "typer"}
"""What the physics may import beside the standard library."""


@cache
def imported_names(path: Path) -> tuple[str, ...]:
    """Return the dotted names that a file imports, wherever in the file it does."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return tuple(names)


def sources(package: str) -> list[Path]:
    return sorted((TOP / package).rglob("*.py"))


def package_xml() -> ElementTree.Element:
    return ElementTree.parse(TOP / "package.xml").getroot()


def test_setup_manifest_and_the_latest_release_of_the_changelog_have_the_version_of_the_code():
    changes = (TOP / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[(\d+\.\d+\.\d+)\] - \d{4}-\d{2}-\d{2}$", changes, re.MULTILINE)
    told = setup_arguments()["version"], package_xml().findtext("version"), released[0]
    assert set(told) == {rover_physics.__version__}


def test_the_manifest_depends_on_every_ros_package_that_is_imported():
    declared = {element.text for element in package_xml().iter("exec_depend")}
    used = {
        module.split(".")[0]
        for package in ("msg_adapters", "rover_planner")
        for path in sources(package)
        for module in imported_names(path)
    }
    of_ros = used & {"rclpy", "rcl_interfaces", "builtin_interfaces"}
    of_ros |= {name for name in used if name.endswith(("_msgs", "_srvs"))}
    assert of_ros - {"grid_map_msgs", "nav2_msgs"} <= declared


def test_every_console_script_is_a_function_that_exists():
    scripts = console_scripts()
    assert scripts.keys() == {"rover_planner", *PROGRAMS}
    for module, function in scripts.values():
        assert callable(getattr(importlib.import_module(module), function))


def test_every_package_is_installed():
    there = {path.parent.relative_to(TOP) for path in TOP.glob("[rm]*/**/__init__.py")}
    assert sorted(setup_arguments()["packages"]) == sorted(".".join(path.parts) for path in there)


def test_every_configuration_and_launch_file_is_installed_with_the_ament_marker():
    installed = dict(setup_arguments()["data_files"])
    assert installed["share/ament_index/resource_index/packages"] == ["resource/rover_planner"]
    for path in (*(TOP / "config").rglob("*"), *(TOP / "launch").glob("*.py")):
        if path.is_file():
            relative = path.relative_to(TOP)
            assert relative.as_posix() in installed[f"share/rover_planner/{relative.parent}"]


def test_every_requirement_is_bounded_on_both_sides_and_locked():
    extras = setup_arguments()["extras_require"]
    names = ("ros", "plots", "view", "bags", "survey", "test")
    assert extras["all"] == [line for name in names for line in extras[name]]
    locked = (TOP / "constraints.txt").read_text(encoding="utf-8")
    names = set(re.findall(r"^([a-z0-9.-]+)==", locked, re.MULTILINE))
    asked_for = [extras[name] for name in ("all", "bench", "dev", "coverage")]
    for requirement in sum(asked_for, setup_arguments()["install_requires"]):
        match = re.fullmatch(r"([\w.-]+)>=[\d.]+,<[\d.]+", requirement)
        assert match, requirement
        assert match[1].lower() in names


@pytest.mark.parametrize("name", sorted(file.stem for file in (TOP / "benchmarks").glob("*.py")))
def test_every_benchmark_can_be_imported(name):
    for needed in ("rclpy", "mujoco"):
        pytest.importorskip(needed)
    importlib.import_module(f"benchmarks.{name}")


def test_the_lower_packages_import_nothing_above_them():
    allowed, above = ROS_FREE | sys.stdlib_module_names, {"rover_planner", "rclpy"}
    for path in sources("rover_physics"):
        assert {name.split(".")[0] for name in imported_names(path)} <= allowed, path
    for path in sources("msg_adapters"):
        assert above.isdisjoint(name.split(".")[0] for name in imported_names(path)), path


# No circle of imports, and they run one way between rooms.


@cache
def modules() -> dict[str, Path]:
    """Return all modules of the packages by their dotted names."""
    found = {}
    for package in ("rover_physics", "msg_adapters", "rover_planner"):
        for path in sources(package):
            parts = path.relative_to(TOP).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def module_of(name: str) -> str:
    """Return the module of the packages that a dotted name is or stands in, empty if in none."""
    while name and name not in modules():
        name = name.rpartition(".")[0]
    return name


@cache
def imports() -> dict[str, frozenset[str]]:
    """Return what each module imports; the façade of a package names what it holds as text."""
    return {
        name: frozenset(map(module_of, imported_names(path))) - {name, ""}
        for name, path in modules().items()
        if path.name != "__init__.py"
    }


def room_of(module: str) -> str:
    """Return the folder a module is in; a file at the top of a package is a room of its own."""
    return module if module.count(".") < 2 else module.rpartition(".")[0]


def test_imports_run_one_way_between_modules_and_between_rooms():
    TopologicalSorter(imports()).prepare()  # else its error names those along the circle
    arrows: dict[str, set[str]] = {}
    for name, others in imports().items():
        beyond = {room_of(other) for other in others} - {room_of(name)}
        arrows.setdefault(room_of(name), set()).update(beyond)
    TopologicalSorter(arrows).prepare()


def test_maps_are_read_and_torques_computed_without_ros():
    program = (
        "import sys; sys.modules.update(dict.fromkeys(['rclpy', 'builtin_interfaces']));"
        "import rover_planner.maps.known_map, rover_planner.traction.supervisor"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_every_name_of_the_api_is_there():
    for name in rover_physics.__all__:
        assert getattr(rover_physics, name) is not None, name
    assert set(rover_physics.__all__) <= set(dir(rover_physics))
    with pytest.raises(AttributeError, match="jugde_path"):
        _ = rover_physics.jugde_path


def test_nothing_is_imported_before_its_use():
    code = (
        "import sys, rover_physics; print('numba' in sys.modules); "
        "from rover_physics import load_rover; load_rover('lsr1'); print('numba' in sys.modules)"
    )
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=300, check=True
    )
    assert ran.stdout.split() == ["False", "False"]
