# SPDX-License-Identifier: Apache-2.0
"""Hostile files for tests: things that are no regular files."""

import os
import socket
from pathlib import Path


def make_oddities(folder: Path) -> list[str]:
    """Make things that are no regular files in a folder; return their names, and worse names."""
    os.mkfifo(folder / "pipe")
    (folder / "folder").mkdir()
    (folder / "loop").symlink_to(folder / "loop")
    (folder / "dangling").symlink_to(folder / "nowhere")
    (folder / "to_zero").symlink_to("/dev/zero")
    with socket.socket(socket.AF_UNIX) as here:
        here.bind(str(folder / "socket"))
    made = ["pipe", "folder", "loop", "dangling", "to_zero", "socket"]
    return [
        *(str(folder / name) for name in made), "/dev/zero", "/dev/full", "/dev/stdin", "/proc",
        "/proc/self/mem", "/proc/kmsg", "x" * 300, "x/" * 3000, "", ".", "..", "\n\x1b[2J", "é",
        "\udcff", "a\0b", str(folder / "folder" / ".." / "nowhere"),
    ]  # fmt: skip
