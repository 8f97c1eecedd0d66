# SPDX-License-Identifier: Apache-2.0
"""colcon builds and tests the package in a clean workspace, and its executables run there."""

import os
import re
import subprocess
import sys
import sysconfig
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs ROS 2")

from support.project.checkout import console_scripts, copy_checkout
from support.project.processes import ProcessToken
from support.ros_fixtures import domain_id

pytestmark = pytest.mark.long
TOOLS = ("setuptools<80", "colcon-common-extensions")
"""colcon links by `setup.py develop --editable`, which setuptools 80 has dropped; Noble has 68."""
HOW = {"copied": (), "linked": ("--symlink-install",)}


@pytest.fixture(scope="module")
def python(tmp_path_factory) -> Path:
    """Return the Python of an environment with colcon from PyPI, and what this one has besides."""
    folder = tmp_path_factory.mktemp("colcon") / "venv"
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    pip = [folder / "bin" / "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, *TOOLS], check=True, timeout=600)
    (site,) = folder.glob("lib/python*/site-packages")
    ours = sysconfig.get_paths()["purelib"]
    (site / "zz_ours.pth").write_text(f"import site; site.addsitedir({ours!r})\n")
    return folder / "bin" / "python"


@pytest.fixture(scope="module", params=HOW)
def workspace(request, python, tmp_path_factory) -> Path:
    """Return a workspace in which the package was built, copied or linked."""
    folder = tmp_path_factory.mktemp(request.param)
    copy_checkout(folder / "src" / "rover_planner")
    built = colcon(python, folder, "build", *HOW[request.param])
    assert "1 package finished" in built.stdout + built.stderr
    return folder


def colcon(python: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run colcon in a workspace."""
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "AMENT_PREFIX_PATH")}
    ended = subprocess.run(
        [python, "-m", "colcon", *words],
        cwd=folder, env=clean, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended


def sourced(folder: Path, command: str) -> str:
    """Run a command in a shell that has sourced the workspace; return what it says.

    Whatever it leaves running is ended.
    """
    token = ProcessToken()
    clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | token.environment
    clean |= {"ROS_DOMAIN_ID": str(domain_id()), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    try:
        ended = subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", f"source install/setup.bash\n{command}"],
            cwd=folder, env=clean, capture_output=True, text=True, timeout=300,
        )  # fmt: skip
    finally:
        token.kill()
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout + ended.stderr


def test_executables_index_and_share_are_where_ros_looks_for_them(workspace, python):
    prefix = workspace / "install" / "rover_planner"
    folder, share = prefix / "lib" / "rover_planner", prefix / "share"
    assert {path.name for path in folder.iterdir()} == console_scripts().keys()
    for path in folder.iterdir():
        assert os.access(path, os.X_OK)
        assert f"usage: {path.name} " in sourced(workspace, f"{path} --help").lower()
    assert (share / "ament_index/resource_index/packages/rover_planner").is_file()
    for name in ("package.xml", "launch/rover.launch.py", "config/parameters/traverse_server.yaml",
                 "config/views/rover.rviz", "config/rovers/m2020.yaml"):  # fmt: skip
        assert (share / "rover_planner" / name).is_file()
    find = "from ament_index_python.packages import get_package_share_directory as find"
    told = sourced(workspace, f"{python} -c \"{find}; print(find('rover_planner'))\"")
    assert Path(told.strip()) == share / "rover_planner"
    load = "from rover_physics import load_rover; print(load_rover('m2020').name)"
    assert sourced(workspace, f'{python} -c "{load}"') == "m2020\n"


def test_colcon_test_runs_tests_of_the_package_and_keeps_their_results(workspace, python):
    words = ["--event-handlers", "console_direct+", "--pytest-args", "-q", "test/shell"]
    told = colcon(python, workspace, "test", *words).stdout
    passed = int(re.search(r"(\d+) passed", told)[1])
    assert passed > 10
    results = ElementTree.parse(workspace / "build" / "rover_planner" / "pytest.xml").getroot()
    assert sum(int(suite.get("tests")) for suite in results.iter("testsuite")) == passed
    summary = colcon(python, workspace, "test-result", "--all").stdout
    assert f"{passed} tests, 0 errors, 0 failures" in summary
