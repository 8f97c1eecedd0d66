# SPDX-License-Identifier: Apache-2.0
"""The project's checkout for tests: its files, its entry points, copies of it."""

import runpy
import shutil
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


def copy_checkout(folder: Path) -> Path:
    """Copy the project's files to a new folder and return that folder."""
    return Path(shutil.copytree(TOP, folder, ignore=shutil.ignore_patterns(*MADE)))
