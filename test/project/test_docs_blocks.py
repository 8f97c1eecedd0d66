# SPDX-License-Identifier: Apache-2.0
"""The code blocks of README and docs run as they are written, from top to bottom of each page.

A page gets an empty folder, and the programs of this checkout by their names. A comment before a
block says why it cannot run here; test_docs_paths.py looks for what it names all the same.
"""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from support.project.checkout import TOP, console_scripts, setup_arguments
from support.project.doc_blocks import Block, read_blocks
from support.project.processes import ProcessToken
from support.ros_fixtures import domain_id

LONGEST, GRACE = 300.0, 20.0
"""Longest time for a block, and for its processes to end after it [s]."""

PAGES = [TOP / "README.md", *sorted((TOP / "docs").rglob("*.md"))]
BLOCKS = {page.relative_to(TOP).as_posix(): read_blocks(page) for page in PAGES}


def test_what_a_robot_does_not_get_from_apt_is_installed_by_pip():
    from_apt = {
        element.text.removeprefix("python3-")
        for element in ElementTree.parse(TOP / "package.xml").getroot().iter("exec_depend")
    }
    required = {
        re.match(r"[\w-]+", requirement)[0].lower().removeprefix("py")
        for requirement in setup_arguments()["install_requires"]
    }
    (by_pip,) = re.findall(
        r"^pip install -c locked.txt (.*)$", (TOP / "README.md").read_text(), re.M
    )
    assert required - from_apt == {word.removeprefix("py") for word in by_pip.split()}


@pytest.fixture
def programs(tmp_path) -> Path:
    """Return a folder with the programs of this checkout, as its setup.py names them."""
    folder = tmp_path / "programs"
    folder.mkdir()
    for name, (module, function) in console_scripts().items():
        # As pip writes it: processes that are started import it again.
        text = f"import sys\nfrom {module} import {function}\n"
        text += f"if __name__ == '__main__':\n    sys.exit({function}())\n"
        (folder / name).write_text(f"#!{sys.executable}\n{text}")
    (folder / "python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    for path in folder.iterdir():
        path.chmod(0o755)
    return folder


@pytest.fixture
def token():
    """Return the mark of the processes of a page; what is left of them in the end is killed."""
    made = ProcessToken()
    yield made
    made.kill()


def run_block(block: Block, folder: Path, programs: Path, token: ProcessToken) -> None:
    """Run a block in a folder; what it prints, its exit code and its processes must be right."""
    shell = block.language == "sh"
    # Job control, as at a prompt, so that `kill %1` ends what a job started too.
    text = f"set -m -e -o pipefail\n{block.text}" if shell else block.text
    # Beside the folder, which holds what blocks write alone.
    script, out, err = (folder.parent / name for name in ("script", "out", "err"))
    script.write_text(text, encoding="utf-8")
    environment = os.environ | token.environment | {
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(TOP),
        "PYTHONUNBUFFERED": "1",
        "ROS_DOMAIN_ID": str(domain_id()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }  # fmt: skip
    with out.open("w") as to_out, err.open("w") as to_err:
        ended = subprocess.run(
            ["bash" if shell else sys.executable, str(script)],
            cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=to_out, stderr=to_err,
            timeout=LONGEST, start_new_session=True,
        )  # fmt: skip
    left = token.wait_until_gone(GRACE)
    said = f"{block.text}\n{out.read_text()}\n{err.read_text()}"
    assert ended.returncode == 0, said
    assert "Traceback" not in said and "[FATAL]" not in said, said
    assert not left, f"processes are left by {said}"
    if block.output is not None:
        assert lines_of(out.read_text()) == lines_of(block.output), said


def lines_of(text: str) -> list[str]:
    return [line.rstrip() for line in text.strip().splitlines()]


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[] if page == "README.md" else [pytest.mark.long])
        for page, blocks in BLOCKS.items()
        if blocks
    ],
)
def test_the_blocks_of_a_page_run_as_written(page, tmp_path, programs, token):
    folder = tmp_path / "work"
    folder.mkdir()
    for block in BLOCKS[page]:
        if not block.not_run:
            run_block(block, folder, programs, token)
