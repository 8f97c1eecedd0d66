# SPDX-License-Identifier: Apache-2.0
"""What README and docs name exists: files, modules, links, options and rooms."""

import pkgutil
import re
from pathlib import Path

import pytest
import typer

from rover_planner.cli import app
from rover_planner.nodes.start import PROGRAMS
from support.project.checkout import TOP, console_scripts

PAGES = sorted(
    path.relative_to(TOP)
    for path in [*TOP.glob("*.md"), *(TOP / "docs").rglob("*.md"), TOP / "examples/README.md"]
)
PACKAGES = ("rover_physics", "rover_planner", "msg_adapters", "support", "benchmarks")
FOLDERS = (*PACKAGES, "config", "docs", "examples", "launch", "test")
SUFFIXES = (".py", ".md", ".yaml", ".npz", ".png", ".xml", ".txt")
MADE = ("mars.npz", "poses.npz", "out.npz", "map.npz", "terrain.npz", "rough.npz", "figure4.png")
"""Files that a reader makes or brings."""
WRITTEN = ("demo_output/", "bench_output/", "studies/")
"""Folders that commands write."""


def read(page: Path) -> str:
    return (TOP / page).read_text(encoding="utf-8")


def current_text(page: Path) -> str:
    """Return a page without old names: the first column of "Renamed", and past releases."""
    text = read(page)
    if page.name == "CHANGELOG.md":
        text = text.split("## [0.1.0]")[0]
        text = re.sub(r"^\| [^|]* (?=\|)", "", text, flags=re.MULTILINE)
    return text


def names_a_place(word: str) -> bool:
    """Tell whether a word is the name of a file or a folder of the project."""
    is_file = re.fullmatch(r"[\w./-]*\w\.\w+", word) and word.endswith(SUFFIXES)
    is_folder = re.fullmatch(r"[\w./-]+/", word) and word.split("/")[0] in FOLDERS
    return bool(is_file or is_folder)


def exists(word: str, page: Path) -> bool:
    """Tell whether a file is there: from the top, beside the page, or somewhere by its name."""
    if (TOP / word).exists() or (TOP / page).parent.joinpath(word).exists():
        return True
    return "/" not in word and any(
        not any(part.startswith(".") for part in path.parts)
        for folder in FOLDERS
        for path in (TOP / folder).rglob(word)
    )


def is_in_code(dotted: str) -> bool:
    """Tell whether a dotted name is a module, or stands in one."""
    try:
        pkgutil.resolve_name(dotted)
    except (ImportError, AttributeError):
        return False
    return True


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_files_links_names_and_targets_of_a_page_exist(page):
    text = current_text(page)
    outside_blocks = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    named = {word for word in re.findall(r"`([^`\n]+)`", outside_blocks) if names_a_place(word)}
    named -= {*MADE, *(word for word in named if word.startswith(WRITTEN))}
    assert not {word for word in named if not exists(word, page)}
    links = {link for link in re.findall(r"\]\(([^)#]+)\)", read(page)) if "://" not in link}
    assert not {link for link in links if not (TOP / page).parent.joinpath(link).exists()}
    words = {word.split("(")[0].rstrip(".") for word in re.findall(r"[\w.]+\(?", text)}
    dotted = {word for word in words if word.split(".")[0] in PACKAGES and "." in word}
    names = {word for word in dotted if not word.endswith((".py", ".md"))}
    assert not {name for name in names if not is_in_code(name)}
    targets = re.findall(r"^(\w+):", (TOP / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(re.findall(r"(?:`|^)make (\w+)", read(page), re.MULTILINE)) <= set(targets)


OPTIONS = {
    name: {option for parameter in command.params for option in parameter.opts}
    for name, command in typer.main.get_command(app).commands.items()
}
"""Options of each subcommand of rover_planner."""


def test_the_page_of_the_command_line_has_every_command():
    text = read(Path("docs/command_line.md"))
    for name in OPTIONS:
        assert re.search(rf"^\| `{name}[ `]", text, re.MULTILINE), name


@pytest.mark.parametrize("page", PAGES, ids=str)
def test_every_option_parameter_argument_topic_and_service_that_a_page_gives_exists(page):
    text = current_text(page)
    for command, rest in re.findall(r"rover_planner (\w+)([^`\n#]*)", text):
        if command in OPTIONS:
            asked = set(re.findall(r"(?<!\w)--[a-z][\w-]*", rest))
            assert asked <= OPTIONS[command], f"rover_planner {command}"
    parameters = {spec.name for one in PROGRAMS.values() for spec in one.parameters}
    assert set(re.findall(r"-p ([a-z]\w*):=", text)) <= parameters
    assert set(re.findall(r"ros2 param set /\w+ (\w+)", text)) <= parameters
    for file, given in re.findall(r"ros2 launch rover_planner ([\w.]+)([^`\n#]*)", text):
        declared = (TOP / "launch" / file).read_text(encoding="utf-8")
        assert [
            name for name in re.findall(r"(\w+):=", given) if f'"{name}"' not in declared
        ] == []
    for node, topic in re.findall(r"ros2 (?:topic|service) [\w -]*/(\w+)/(\w+)", text):
        assert f"~/{topic}" in PROGRAMS[node].topics
    for program in re.findall(r"ros2 run rover_planner (\w+)", text):
        assert program in console_scripts()


@pytest.mark.parametrize("package", ["rover_physics", "rover_planner"])
def test_readme_lists_every_room(package):
    table = read(Path("README.md")).split(f"| `{package}/` |", 1)[1].split("\n\n", 1)[0]
    folders = {path.parent.name for path in (TOP / package).glob("*/__init__.py")}
    assert set(re.findall(r"^\| `(\w+)/`", table, re.MULTILINE)) == folders


def test_every_node_and_command_that_is_installed_is_in_the_docs():
    text = "".join(read(page) for page in PAGES)
    assert not [name for name in console_scripts() if f"`{name}" not in text]
