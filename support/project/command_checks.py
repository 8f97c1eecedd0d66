# SPDX-License-Identifier: Apache-2.0
"""Holds commands of the docs against the product without running them: names, options, values."""

import importlib
import importlib.util
import re
import shutil
from pathlib import Path
from typing import Any

import typer
import yaml

from rover_planner.cli import app
from rover_planner.nodes.programs import PROGRAMS, make_app
from rover_planner.shell.run_app import run_app
from support.project.checkout import TOP, console_scripts

ROBOT_TOOLS = ("rosdep", "colcon", "ros2", "apt", "sudo")
"""Programs that a robot has and this machine need not have."""


def check_command(words: tuple[str, ...]) -> None:
    """Fail where a command names a program, file, module, option or parameter that is not there.

    Raises:
        AssertionError, PlanningError, RoverError: Says what is not there.
    """
    while words and re.fullmatch(r"\w+=.*", words[0]):  # NAME=VALUE before the program
        words = words[1:]
    if not words:
        return
    name, arguments = words[0], words[1:]
    if name == "rover_planner":
        _check_subcommand(arguments)
    elif name in PROGRAMS:
        _check_node(name, arguments)
    elif name in ("python", "python3"):
        _check_python(arguments)
    elif name == "ros2":
        _check_ros2(arguments)
    elif name.startswith("."):
        assert (TOP / name).is_file(), f"no file {name}"
    else:
        builtin = name in ("cd", "source", "kill", "wait", "export", "echo", "pip")
        assert builtin or name in ROBOT_TOOLS or shutil.which(name), f"no program {name}"


def _check_subcommand(words: tuple[str, ...]) -> None:
    """Let the parser of a subcommand of rover_planner read its words."""
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    if words == ("--help",):
        return
    assert words and words[0] in commands, f"rover_planner has no command {words[:1]}"
    if "--help" in words or words[1:] == ("COMMAND",):
        return
    commands[words[0]].make_context(words[0], list(words[1:]))


def _check_node(name: str, words: tuple[str, ...]) -> None:
    """Let the parser of a node program read its words, and its table the parameters."""
    own, ros = _split_at(words, "--ros-args")
    if "--help" not in own:
        run_app(make_app(name), name, own)
    assert set(ros[0::2]) <= {"-p", "-r", "--params-file"}, f"{name} {' '.join(ros)}"
    for option, value in zip(ros[0::2], ros[1::2], strict=True):
        if option == "--params-file":
            check_parameter_file(name, TOP / value)
        if option == "-p":
            parameter, given = value.split(":=")
            check_parameters(name, {parameter: yaml.safe_load(given)})


def check_parameter_file(node: str, path: Path) -> None:
    """Hold the parameters of a file for a node against its table; `/**` is every node."""
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert set(values) & {"/**", node}, f"{path.name} has nothing for {node}"
    for section in ("/**", node):
        check_parameters(node, values.get(section, {}).get("ros__parameters", {}))


def check_parameters(node: str, values: dict[str, Any]) -> None:
    """Hold parameters against the table of their node."""
    specs = {spec.name: spec for spec in PROGRAMS[node].parameters}
    for name, value in values.items():
        assert name in specs, f"{node} has no parameter {name}"
        specs[name].check(tuple(value) if isinstance(value, list) else value)


def _check_python(words: tuple[str, ...]) -> None:
    """Look for the module that is run, and compile a script of one word."""
    if words[0] == "-c":
        return
    assert words[0] == "-m", f"python {' '.join(words)}"
    module, arguments = words[1], words[2:]
    if module in ROBOT_TOOLS:
        return
    assert importlib.util.find_spec(module) is not None, f"no module {module}"
    if module.startswith("benchmarks."):
        benchmark = typer.Typer()
        benchmark.command()(importlib.import_module(module).main)
        typer.main.get_command(benchmark).make_context(module, list(arguments))
    if module == "rover_planner":
        _check_subcommand(arguments)


def _check_ros2(words: tuple[str, ...]) -> None:
    """Look for what the ros2 command is asked to start, to call or to set."""
    verb, rest = words[0], words[1:]
    if verb == "run":
        assert rest[0] == "rover_planner" and rest[1] in console_scripts(), rest
        check_command(rest[1:])
    elif verb == "launch":
        assert rest[0] == "rover_planner", words
        text = (TOP / "launch" / rest[1]).read_text(encoding="utf-8")
        for word in rest[2:]:
            assert f'"{word.split(":=")[0]}"' in text, f"{rest[1]} has no argument {word}"
    elif words[:2] == ("param", "set"):
        check_parameters(rest[1].lstrip("/"), {rest[2]: yaml.safe_load(rest[3])})
    else:
        (name,) = (word for word in rest if word.startswith("/"))
        node, _, topic = name.strip("/").partition("/")
        assert node in PROGRAMS, words
        assert not topic or f"~/{topic}" in PROGRAMS[node].topics, f"{node} has no {topic}"


def _split_at(words: tuple[str, ...], mark: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the words before and behind a mark."""
    if mark not in words:
        return words, ()
    place = words.index(mark)
    return words[:place], words[place + 1 :]
