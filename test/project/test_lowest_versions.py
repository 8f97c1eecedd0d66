# SPDX-License-Identifier: Apache-2.0
"""The lowest versions that setup.py declares install, and what is installed with them works."""

import os
import re
import subprocess
import sys

import pytest

from support.project.checkout import TOP, copy_checkout, setup_arguments

LIBRARY = """
import numpy as np
from rover_physics import SweepOptions, judge_path, judge_reach, load_rover, load_terrain
from rover_physics import score_poses
from rover_physics.traction.balance import BalanceWriter, MeasuredState
from rover_physics.traction.program import ProgramInputs
from rover_physics.traction.solver import TractionWorkspace, solve_traction

rover, ground = load_rover("lsr1"), load_terrain("spirit")
poses = np.array([[-44.684, -19.499, 3.41], [-44.78, -19.53, 3.41]])
for policy in ("equal", "optimal"):
    prediction, verdict = judge_path(rover, ground, poses, SweepOptions(policy=policy))
    assert verdict.traversable and prediction.settled.all(), verdict.reason
assert score_poses(rover, ground, poses).passable.all()
assert not judge_reach(rover, ground, poses[0], (-40.0, -19.5, -2.0)).possible
level = MeasuredState(0.0, 0.0, 0.0, np.zeros(2), np.zeros(6))
inputs = ProgramInputs(np.full(6, 0.8), rover.wheel.max_torque, rover.wheel.radius)
answer = solve_traction(TractionWorkspace(), BalanceWriter(rover).write(level, 5.0), inputs)
assert not answer.fallback and abs(answer.tractions.sum() - 5.0) < 1e-6, answer
np.savez("poses.npz", poses=np.zeros((1, 3)))
"""


def lowest_pins() -> dict[str, list[str]]:
    """Return the versions of constraints-lowest.txt by name."""
    pins: dict[str, list[str]] = {}
    text = (TOP / "constraints-lowest.txt").read_text(encoding="utf-8")
    for name, version in re.findall(r"^([a-z]+)==([\d.]+)", text, re.MULTILINE):
        pins.setdefault(name, []).append(version)
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


@pytest.mark.long
def test_library_and_programs_run_with_the_lowest_versions_and_without_ros(tmp_path):
    copy = copy_checkout(tmp_path / "rover_planner")
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    programs, clean = tmp_path / "venv" / "bin", dict(os.environ)
    clean.pop("PYTHONPATH", None)  # else this checkout is imported

    def run(name, *words):
        ended = subprocess.run(
            [programs / name, *words],
            cwd=tmp_path, env=clean, capture_output=True, text=True, timeout=900,
        )  # fmt: skip
        return ended.returncode, ended.stdout, ended.stderr

    constraints = str(copy / "constraints-lowest.txt")
    assert run("pip", "install", "--quiet", "-c", constraints, str(copy))[0] == 0
    installed = dict(line.lower().split("==") for line in run("pip", "freeze")[1].split()
                     if "==" in line)  # fmt: skip
    for name, versions in lowest_pins().items():
        assert installed[name] in versions
    assert run("python", "-c", LIBRARY) == (0, "", "")
    for words, told in (
        (["--help"], "predict"),
        (["predict", "--help"], "TERRAIN"),
        (["terrain", "mars.npz", "--size", "6"], "wrote mars.npz: 120 x 120 cells"),
        (["predict", "lsr1", "mars.npz", "poses.npz", "out.npz", "--classes", "--torque-ranges"],
         "wrote out.npz: 1 waypoint, "),
    ):  # fmt: skip
        code, out, err = run("rover_planner", *words)
        assert (code, err) == (0, "") and told in out
    code, out, err = run("traverse_server")
    assert (code, out, err.count("\n")) == (2, "", 1) and "rover_planner[ros]" in err
