"""The lowest versions that setup.py declares install, and what is installed with them works."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from support.project.checkout import TOP, copy_checkout, setup_arguments

CORE = """
import numpy as np
from rover_physics import judge_path, load_rover, load_terrain
from rover_physics.traction.balance import BalanceWriter, MeasuredState
from rover_physics.traction.program_inputs import ProgramInputs
from rover_physics.traction.solver import TractionWorkspace, solve_traction

rover, ground = load_rover("lsr1"), load_terrain("spirit")
poses = np.array([[-44.684, -19.499, 3.41], [-44.78, -19.53, 3.41]])
prediction, verdict = judge_path(rover, ground, poses)
assert verdict.traversable and prediction.settled.all(), verdict.reason
level = MeasuredState(0.0, 0.0, 0.0, np.zeros(2), np.zeros(6))
inputs = ProgramInputs(np.full(6, 0.8), rover.wheel.max_torque, rover.wheel.radius)
answer = solve_traction(TractionWorkspace(), BalanceWriter(rover).write(level, 5.0), inputs)
assert not answer.fallback and abs(answer.tractions.sum() - 5.0) < 1e-6, answer
"""
MORE = """
import numpy as np
from rover_physics import SweepOptions, classify_path, find_torque_ranges, judge_path
from rover_physics import judge_reach, load_rover, load_terrain, score_poses

rover, ground = load_rover("lsr1"), load_terrain("spirit")
poses = np.array([[-44.684, -19.499, 3.41], [-44.78, -19.53, 3.41]])
prediction, verdict = judge_path(rover, ground, poses, SweepOptions(policy="optimal"))
assert verdict.traversable and prediction.settled.all(), verdict.reason
assert score_poses(rover, ground, poses).passable.all()
assert len(classify_path(rover, ground, poses)) == 2
assert (find_torque_ranges(rover, ground, poses).lowest < 0.0).all()
assert not judge_reach(rover, ground, poses[0], (-40.0, -19.5, -2.0)).possible
"""


def lowest_pins() -> dict[str, list[str]]:
    """Return the versions of constraints-lowest.txt by name."""
    pins: dict[str, list[str]] = {}
    for line in (TOP / "constraints-lowest.txt").read_text(encoding="utf-8").splitlines():
        match = re.match(r"([a-z]+)==([\d.]+)", line)
        if match:
            pins.setdefault(match[1], []).append(match[2])
    return pins


def test_the_lowest_versions_are_those_of_setup():
    declared = {}
    for requirement in setup_arguments()["install_requires"]:
        name, bound = re.match(r"([\w-]+)>=([\d.]+),", requirement).groups()
        declared[name.lower()] = bound
    pins = lowest_pins()
    assert pins.keys() == declared.keys()
    for name, versions in pins.items():
        for version in versions:
            assert f"{version}.".startswith(f"{declared[name]}."), f"{name}=={version}"


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """Return the folder of programs of an environment with the lowest versions and no ROS."""
    folder = tmp_path_factory.mktemp("lowest")
    copy = copy_checkout(folder / "rover_planner")
    subprocess.run([sys.executable, "-m", "venv", folder / "venv"], check=True)
    programs = folder / "venv" / "bin"
    constraints = copy / "constraints-lowest.txt"
    install = [programs / "pip", "install", "--quiet", "-c", constraints, str(copy)]
    subprocess.run(install, check=True, timeout=600)
    return programs


def run(environment: Path, folder: Path, name: str, *words: str) -> subprocess.CompletedProcess:
    """Run a program of the environment, without this checkout on its way."""
    clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    return subprocess.run(
        [environment / name, *words],
        cwd=folder,
        env=clean,
        capture_output=True,
        text=True,
        timeout=900,
    )


@pytest.mark.long
def test_the_lowest_versions_are_what_pip_installs(environment, tmp_path):
    ended = run(environment, tmp_path, "pip", "list", "--format=freeze")
    installed = dict(line.lower().split("==") for line in ended.stdout.split())
    for name, versions in lowest_pins().items():
        assert installed[name] in versions


@pytest.mark.long
def test_the_command_line_runs_with_the_lowest_versions(environment, tmp_path):
    for words, told in (
        (["--help"], "predict"),
        (["predict", "--help"], "TERRAIN"),
        (["terrain", "mars.npz", "--size", "6"], "wrote mars.npz: 120 x 120 cells"),
    ):
        ended = run(environment, tmp_path, "rover_planner", *words)
        assert (ended.returncode, ended.stderr) == (0, "")
        assert told in ended.stdout
    make = "import numpy as np; np.savez('poses.npz', poses=np.zeros((1, 3)))"
    assert run(environment, tmp_path, "python", "-c", make).returncode == 0
    words = ["predict", "lsr1", "mars.npz", "poses.npz", "out.npz", "--classes", "--torque-ranges"]
    ended = run(environment, tmp_path, "rover_planner", *words)
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith("wrote out.npz: 1 waypoint, ")
    ended = run(environment, tmp_path, "rover_planner", "predict", "lsr1")
    assert ended.returncode == 2 and ended.stderr.count("\n") == 1


@pytest.mark.long
@pytest.mark.parametrize("program", [CORE, MORE], ids=["core", "more"])
def test_the_library_runs_with_the_lowest_versions(environment, tmp_path, program):
    ended = run(environment, tmp_path, "python", "-c", program)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.long
def test_a_plain_installation_says_what_its_nodes_need(environment, tmp_path):
    ended = run(environment, tmp_path, "traverse_server")
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert "rover_planner[ros]" in ended.stderr
