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
BLOCKS = [block for page in PAGES for block in read_blocks(page)]


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


class Reader:
    """A person at a shell in an empty folder, who runs one block after another."""

    def __init__(self, folder: Path, programs: Path):
        self.folder = folder
        self.token = ProcessToken()
        self.environment = os.environ | self.token.environment | {
            "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(TOP),
            "PYTHONUNBUFFERED": "1",
            "ROS_DOMAIN_ID": str(domain_id()),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        }  # fmt: skip

    def run(self, block: Block) -> None:
        """Run a block; what it says on stdout, its exit code and its processes must be right."""
        shell = block.language == "sh"
        # Job control, as at a prompt, so that `kill %1` ends what a job started too.
        text = f"set -m -e -o pipefail\n{block.text}" if shell else block.text
        script = self._aside("script")
        script.write_text(text, encoding="utf-8")
        with open(self._aside("out"), "w") as out, open(self._aside("err"), "w") as err:
            ended = subprocess.run(
                ["bash" if shell else sys.executable, str(script)],
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=err,
                timeout=LONGEST,
                start_new_session=True,
            )
        left = self.token.wait_until_gone(GRACE)
        out_text, err_text = self._aside("out").read_text(), self._aside("err").read_text()
        said = f"{block}\n{out_text}\n{err_text}"
        assert ended.returncode == 0, said
        assert "Traceback" not in said and "[FATAL]" not in said, said
        assert not left, f"processes are left by {said}"
        if block.output is not None:
            assert lines_of(out_text) == lines_of(block.output), said

    def _aside(self, name: str) -> Path:
        """Return a file beside the reader's folder, which holds what blocks write alone."""
        return self.folder.parent / name


def lines_of(text: str) -> list[str]:
    return [line.rstrip() for line in text.strip().splitlines()]


@pytest.fixture
def reader(tmp_path, programs):
    """Return a reader in a fresh folder; whatever is left at the end is killed."""
    folder = tmp_path / "work"
    folder.mkdir()
    person = Reader(folder, programs)
    yield person
    person.token.kill()


@pytest.mark.slow
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[] if page == "README.md" else [pytest.mark.long])
        for page in dict.fromkeys(block.page for block in BLOCKS)
    ],
)
def test_the_blocks_of_a_page_run_as_written(page, reader):
    for block in BLOCKS:
        if block.page == page and not block.not_run:
            reader.run(block)
