"""The checkout as tests of the project see it: its files, its entry points, copies of it."""

import runpy
import shutil
from pathlib import Path
from typing import Any
from unittest import mock

TOP = Path(__file__).resolve().parents[2]
MADE = ("*.egg-info", "__pycache__", ".*", "build", "install", "log", "*_output")
"""What is in a checkout and no part of it."""


def setup_arguments() -> dict[str, Any]:
    """Run setup.py and return what it hands to setuptools."""
    with mock.patch("setuptools.setup") as setup:
        runpy.run_path(str(TOP / "setup.py"))
    return setup.call_args.kwargs


def console_scripts() -> dict[str, tuple[str, str]]:
    """Return module and function of each program that is installed, by its name."""
    lines = setup_arguments()["entry_points"]["console_scripts"]
    return {
        name: tuple(target.split(":")) for name, target in (line.split(" = ") for line in lines)
    }


def copy_checkout(folder: Path) -> Path:
    """Copy what belongs to the project to a new folder, and return it."""
    return Path(shutil.copytree(TOP, folder, ignore=shutil.ignore_patterns(*MADE)))
