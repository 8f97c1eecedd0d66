# SPDX-License-Identifier: Apache-2.0
"""The examples run as they are: each prints its answers and draws its picture."""

import ast
import importlib
import os
import subprocess
import sys

import pytest

from support.project.checkout import TOP
from support.ros_fixtures import domain_id

FOLDER = TOP / "examples"
SHOWN = {
    "01_judge_a_path": ("refused at waypoint 86", "front_left wheel slips"),
    "02_compare_policies": ("tallest step [cm]", "optimal "),
    "03_your_own_rover_from_a_urdf": ("kit_rover, 6.2 kg", "servo: climbs the step"),
    "04_a_map_from_a_point_cloud": ("seen, +0.35 rad: unknown", "filled, +0.35 rad: traversable"),
    "05_find_a_path": ("straight ahead: front_right wheel drops off", "search: found"),
    "06_ask_the_server_over_ros": (
        "to -45.5, -20.5: 1.6 m",
        "-25.0: no: no path within the map",
    ),
    "07_survey_a_whole_map": ("10900 cells at 8 headings", "reachable with return: 16.6 m2"),
    "08_traction_control_against_mujoco": ("servos: arrived", "control: arrived"),
    "09_take_advice": ("rock: refused: belly clearance", "kg less at the arm's tip"),
}
"""What each example prints, among other things."""


def test_every_example_is_tested_and_in_the_table_of_the_folder():
    names = sorted(path.stem for path in FOLDER.glob("*.py"))
    assert names == list(SHOWN)
    table = (FOLDER / "README.md").read_text(encoding="utf-8")
    assert not [name for name in names if f"[{name}.py]({name}.py)" not in table]


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long if name > "02" else ()) for name in SHOWN]
)
def test_an_example_prints_and_draws_what_it_claims(name, tmp_path):
    from matplotlib.image import imread

    done = subprocess.run(
        [sys.executable, FOLDER / f"{name}.py", tmp_path],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(TOP), "ROS_DOMAIN_ID": str(domain_id())},
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    assert not [words for words in SHOWN[name] if words not in done.stdout], done.stdout
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    assert all(imread(picture)[..., :3].std() > 0.05 for picture in pictures)


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_imports_what_there_is(name):
    text = (FOLDER / f"{name}.py").read_text(encoding="utf-8")
    for node in ast.parse(text).body:
        if isinstance(node, ast.ImportFrom) and node.module.startswith(("rover_", "msg_")):
            module = importlib.import_module(node.module)
            assert all(hasattr(module, alias.name) for alias in node.names)
