# SPDX-License-Identifier: Apache-2.0
"""The project's checkout for tests: its files, its entry points, copies of it."""

import ast
import runpy
import shutil
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

TOP = Path(__file__).resolve().parents[2]
MADE = ("*.egg-info", "__pycache__", ".*", "build", "install", "log", "*_output")
"""Patterns of generated files, which are not part of the project."""


def setup_arguments() -> dict[str, Any]:
    """Run setup.py and return the arguments of setuptools.setup."""
    with mock.patch("setuptools.setup") as setup:
        runpy.run_path(str(TOP / "setup.py"))
    return setup.call_args.kwargs


def console_scripts() -> dict[str, tuple[str, str]]:
    """Return module and function of each installed program, by name."""
    lines = setup_arguments()["entry_points"]["console_scripts"]
    return {
        name: tuple(target.split(":")) for name, target in (line.split(" = ") for line in lines)
    }


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


def copy_checkout(folder: Path) -> Path:
    """Copy the project's files to a new folder and return that folder."""
    return Path(shutil.copytree(TOP, folder, ignore=shutil.ignore_patterns(*MADE)))


def copy_kernels(packages: Path) -> None:
    """Copy the compiled kernels beside copies of the packages with the same sources."""
    for kind in ("nbi", "nbc", "sha256"):  # the last tells the sources that they belong to
        for kernel in TOP.glob(f"rover_*/**/__pycache__/*.{kind}"):
            copy = packages / kernel.relative_to(TOP)
            copy.parent.mkdir(exist_ok=True)
            shutil.copy(kernel, copy)
