# SPDX-License-Identifier: Apache-2.0
"""The node programs have help that is true, need ROS only to run, and name wrong words."""

import json
import os
import re
import signal
import subprocess
import sys

import pytest
import yaml
from rclpy.parameter import Parameter

from rover_planner.nodes import start
from rover_planner.nodes.mission_planner import MissionPlanner
from rover_planner.nodes.mission_planner import main as mission_planner
from rover_planner.nodes.programs import PROGRAMS
from rover_planner.nodes.rover_simulator import RoverSimulator
from rover_planner.nodes.rover_simulator import main as rover_simulator
from rover_planner.nodes.traction_controller import TractionController
from rover_planner.nodes.traction_controller import main as traction_controller
from rover_planner.nodes.traverse_server import TraverseServer
from rover_planner.nodes.traverse_server import main as traverse_server
from rover_planner.shell.extras import PLAIN
from support.command_line import REPOSITORY
from support.project.checkout import console_scripts, setup_arguments
from support.waiting import wait_until

MAINS = {
    "traverse_server": traverse_server,
    "traction_controller": traction_controller,
    "rover_simulator": rover_simulator,
    "mission_planner": mission_planner,
}
NODES = {
    "traverse_server": TraverseServer,
    "traction_controller": TractionController,
    "rover_simulator": RoverSimulator,
    "mission_planner": MissionPlanner,
}
OF_ROS = re.compile(r"/(parameter_events|rosout|.*/(\w+_parameters?\w*|get_type_description))$")


def run_code(code, folder=REPOSITORY):
    """Run code in a process of its own, with a folder first on Python's path."""
    return subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{REPOSITORY}"},
        capture_output=True,
        text=True,
        timeout=60,
    )


RUN_ALL = """
import contextlib, io, json, sys
sys.modules["rclpy"] = None
from rover_planner.nodes import start
from rover_planner.nodes.programs import PROGRAMS
ended = {}
for name in PROGRAMS:
    for words in (["--help"], []):
        sys.argv = [name, *words]
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = getattr(start, f"start_{name}")()
        ended[" ".join(sys.argv)] = code, out.getvalue(), err.getvalue()
print(json.dumps(ended))
"""


@pytest.fixture(scope="module")
def ended_without_ros():
    """Return exit code, stdout and stderr of each program with and without --help, by words."""
    ran = run_code(RUN_ALL)
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


@pytest.mark.parametrize("name", PROGRAMS)
def test_help_comes_without_ros_and_lists_every_parameter(name, ended_without_ros):
    code, out, err = ended_without_ros[f"{name} --help"]
    assert (code, err) == (0, "")
    program, told = PROGRAMS[name], " ".join(out.split())
    assert told.startswith(f"Usage: {name} ")
    assert program.what in told and program.topics in told
    for spec in program.parameters:
        assert f" {spec.name}: {spec.type_name}, default " in told
        assert spec.meaning in told
        assert re.search(rf"^ +{spec.name}: {spec.type_name}, ", out, re.MULTILINE)
    assert max(map(len, out.splitlines())) <= 99


@pytest.mark.parametrize("name", PROGRAMS)
def test_without_ros_a_program_says_in_one_line_what_to_install(name, ended_without_ros):
    code, out, err = ended_without_ros[name]
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(f"{name}: ") and "pip install 'rover_planner[ros]'" in err


START = "from rover_planner.nodes.start import start_{name} as s; sys.exit(s())"


@pytest.mark.parametrize(
    ("absent", "said"),
    [
        ("rclpy.built_for_another_python", "pip install 'rover_planner[ros]'"),
        ("diagnostic_msgs", "cannot import diagnostic_msgs"),
        ("osqp", "pip install osqp"),
    ],
)
def test_a_part_that_cannot_be_imported_is_named_in_one_line(absent, said, tmp_path):
    if "." in absent:
        (tmp_path / "rclpy").mkdir()
        (tmp_path / "rclpy" / "__init__.py").write_text(f"import {absent}")
    name = "traverse_server"
    code = f"import sys; sys.modules[{absent!r}] = None; "
    ended = run_code(code + START.format(name=name), tmp_path)
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert ended.stderr.startswith(f"{name}: ")
    assert absent in ended.stderr and said in ended.stderr


SIGNAL_AT_IMPORT = """
import os, sys
class Signal:
    def find_spec(self, name, path=None, target=None):
        if name == "rover_planner.nodes.mission_planner":
            os.kill(os.getpid(), {number})
sys.meta_path.insert(0, Signal())
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_program_cleanly_while_it_is_imported(how):
    code = SIGNAL_AT_IMPORT.format(number=int(how)) + START.format(name="mission_planner")
    ended = run_code(code)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


def test_what_a_plain_installation_brings_is_known_by_its_modules():
    required = {
        re.match(r"[\w-]+", line)[0].lower() for line in setup_arguments()["install_requires"]
    }
    assert {package.lower() for package in PLAIN.values()} == required


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--colour", "red"], "--colour"),
        (["terrain_file:=mars.npz"], "--ros-args -p"),
        (["--ros-args", "-p", "friction"], "-p friction"),
        (["--ros-args", "--colour"], "--colour"),
    ],
)
def test_wrong_words_are_exit_code_2_and_named(name, words, said, capfd):
    assert MAINS[name](words) == 2
    err = capfd.readouterr().err
    assert said in err and "Traceback" not in err and "/rcl/" not in err


@pytest.mark.parametrize("name", PROGRAMS)
def test_the_topics_in_the_help_are_those_of_the_node(name, ros):
    node = ros.spin(NODES[name](context=ros.context))
    kinds = ("publisher", "subscriber", "service", "client")

    def names() -> set[str]:
        found = set()
        for kind in kinds:
            ask = getattr(node, f"get_{kind}_names_and_types_by_node")
            found |= {topic for topic, _ in ask(name, "/") if not OF_ROS.match(topic)}
        return found

    told = set(re.findall(r"[~/]?[a-z_/]+", PROGRAMS[name].topics))
    told -= {"subscribes", "serves", "publishes", "calls", ""}
    told = {re.sub(r"^~", f"/{name}", topic) for topic in told}
    told = {topic if topic.startswith("/") else f"/{topic}" for topic in told}
    # Topics that need follow_commands, grid_map_msgs or hazard_map are in the help, but not here.
    hazards = {f"/traverse_server/hazard_map/{which}" for which in ("worst", "best")}
    commands = {"/cmd_vel", "/traction_controller/commands", "/elevation_map"}
    optional = (commands | hazards) & told
    wait_until(lambda: told - optional <= names(), f"{told - optional}")
    assert names() <= told | {"/tf"}


@pytest.mark.parametrize("name", [name for name in PROGRAMS if PROGRAMS[name].parameters])
def test_a_parameter_that_does_not_exist_is_warned_of_once_with_the_nearest(name, ros, capfd):
    wrong = [Parameter("rovr", value="lsr1"), Parameter("zzz", value=1)]
    wrong += [Parameter("rover", value="m2020"), Parameter("use_sim_time", value=False)]  # exist
    node = ros.spin(NODES[name](context=ros.context, parameter_overrides=wrong))
    assert not node.has_parameter("rovr")
    err = capfd.readouterr().err
    assert err.count("parameter rovr does not exist and is ignored; the nearest is rover") == 1
    assert err.count("parameter zzz does not exist and is ignored; --help lists") == 1
    assert err.count("does not exist") == 2


@pytest.mark.parametrize("name", [name for name in PROGRAMS if PROGRAMS[name].parameters])
def test_a_node_takes_its_parameter_file_in_a_namespace(name, ros, capfd):
    file = REPOSITORY / "config" / "parameters" / f"{name}.yaml"
    words = ["--ros-args", "--params-file", str(file), "-r", "__ns:=/one"]
    words += ["-r", "diagnostics:=/diagnostics"]
    node = ros.spin(NODES[name](context=ros.context, cli_args=words))
    assert node.get_fully_qualified_name() == f"/one/{name}"
    for key, value in yaml.safe_load(file.read_text())["/**"]["ros__parameters"].items():
        assert node.get_parameter(key).value == value

    def publishes():
        found = node.get_publishers_info_by_topic("/diagnostics")
        return any((one.node_namespace, one.node_name) == ("/one", name) for one in found)

    wait_until(publishes, "diagnostics")
    assert "does not exist" not in capfd.readouterr().err


def test_every_program_is_installed_by_its_entry_point():
    scripts = console_scripts()
    for name in PROGRAMS:
        assert scripts[name] == (start.__name__, f"start_{name}")
