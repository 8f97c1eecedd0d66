# SPDX-License-Identifier: Apache-2.0
"""The node programs have help that is true, need ROS only to run, and name wrong words."""

import importlib
import json
import os
import re
import signal
import subprocess
import sys

import pytest
import yaml
from rclpy.node import Node

from rover_planner.nodes import start
from rover_planner.nodes.start import PROGRAMS
from rover_planner.shell.extras import PLAIN
from support.project.checkout import TOP, setup_arguments
from support.ros_fixtures import domain_id
from support.waiting import wait_until

START, MUJOCO = "--start=0,0,0", ("--ros-args", "-p", "engine:=mujoco", "-p")
MODULES = {name: importlib.import_module(f"rover_planner.nodes.{name}") for name in PROGRAMS}
PARAMETER_FILES = TOP / "config" / "parameters"
OF_ROS = re.compile(r"/(parameter_events|rosout|.*/(\w+_parameters?\w*|get_type_description))$")


RUN_ALL = """
import contextlib, io, json, sys
sys.modules["rclpy"] = None
from rover_planner.nodes import start
from rover_planner.nodes.start import PROGRAMS
ended = {}
for name in PROGRAMS:
    sys.argv, out, err = [name, "--help"], io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = getattr(start, f"start_{name}")()
    ended[name] = code, out.getvalue(), err.getvalue()
print(json.dumps(ended))
"""


@pytest.fixture(scope="module")
def helps_without_ros():
    """Return exit code, stdout and stderr of each program with --help, by its name."""
    ran = subprocess.run(
        [sys.executable, "-c", RUN_ALL],
        env=os.environ | {"PYTHONPATH": str(TOP)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


@pytest.mark.parametrize("name", PROGRAMS)
def test_help_comes_without_ros_and_lists_every_parameter(name, helps_without_ros):
    code, out, err = helps_without_ros[name]
    assert (code, err) == (0, "")
    program, told = PROGRAMS[name], " ".join(out.split())
    assert told.startswith(f"Usage: {name} ")
    assert program.what in told and program.topics in told
    for spec in program.parameters:
        assert f" {spec.name}: {spec.type_name}, default " in told
        assert spec.meaning in told
        assert re.search(rf"^ +{spec.name}: {spec.type_name}, ", out, re.MULTILINE)
    assert max(map(len, out.splitlines())) <= 99


@pytest.mark.parametrize(
    ("absent", "said"),
    [
        ("rclpy", r"source it, or pip install 'rover_planner\[ros\]'$"),
        ("rclpy.built_for_3_9", r"install 'rover_planner\[ros\]'.* import rclpy\.built_for_3_9"),
        ("diagnostic_msgs", "cannot import diagnostic_msgs"),
        ("osqp", "needs osqp.* pip install osqp"),
    ],
)
def test_a_part_that_cannot_be_imported_is_named_in_one_line(absent, said, monkeypatch, capfd):
    def fail(_name):
        raise ModuleNotFoundError(f"No module named {absent!r}", name=absent)

    monkeypatch.setitem(sys.modules, absent, None)
    monkeypatch.setattr(start.importlib, "import_module", fail)
    monkeypatch.setattr(sys, "argv", ["traverse_server"])
    assert start.start_traverse_server() == 2
    out, err = capfd.readouterr()
    assert (out, err.count("\n")) == ("", 1) and err.startswith("traverse_server: ")
    assert re.search(said, err)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(("name", "code"), [("traverse_server", 0), ("mission_planner", 130)])
def test_a_signal_ends_a_program_cleanly_while_it_is_imported(name, code, how, monkeypatch, capfd):
    monkeypatch.setattr(start.importlib, "import_module", lambda _: os.kill(os.getpid(), how))
    monkeypatch.setattr(sys, "argv", [name])
    assert getattr(start, f"start_{name}")() == code
    assert capfd.readouterr() == ("", "")


def test_what_a_plain_installation_brings_is_known_by_its_modules():
    required = {
        re.match(r"[\w-]+", line)[0].lower() for line in setup_arguments()["install_requires"]
    }
    assert {package.lower() for package in PLAIN.values()} == required


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("traverse_server", ["--colour", "red"], "--colour"),
        ("rover_simulator", ["terrain_file:=mars.npz"], "--ros-args -p"),
        ("rover_simulator", ["--engine", "horses"], "'horses'; it must be one of quasi_static"),
        ("rover_simulator", ["--ros-args", "-p", "soil:=dry_snad"], "no soil 'dry_snad'"),
        ("rover_simulator", [*MUJOCO, "soil:=dry_sand"], "soil is "),
        ("rover_simulator", [*MUJOCO, "policy:=optimal"], "policy is "),
        ("traverse_server", ["--ros-args", "-p", "terrain_file:=/no/file.npz"], "/no/file.npz"),
        ("traction_controller", ["--ros-args", "-p", "friction"], "-p friction"),
        ("traction_controller", ["--ros-args", "-p", "use_sim_time:=1"], "expecting type 'BOOL'"),
        ("mission_planner", ["--ros-args", "--colour"], "--colour"),
        ("mission_planner", ["--start=0,0,0"], "--goal"),
        ("mission_planner", [START[:-2], "--goal=1,0,0"], "'0,0' is no pose; it must be X,Y,YAW"),
        ("mission_planner", [START, "--goal=1,0,0", "--map=opportunity"], "presets are spirit"),
        ("mission_planner", [START, "--goal=1,0,0", "--timeout=nan"], "nan; it must be a time"),
    ],
)
def test_wrong_words_are_exit_code_2_and_named(name, words, said, capfd, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id()))
    assert MODULES[name].main(words) == 2
    err = capfd.readouterr().err
    assert said in err.strip().splitlines()[-1] and "Traceback" not in err and "/rcl/" not in err
    if name == "mission_planner":  # the nodes log it
        assert err.startswith(f"{name}: ") and err.count("\n") == 1


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_node_in_a_namespace_has_the_topics_of_the_help_and_tells_of_wrong_parameters(
    name, ros, capfd
):
    words, wrong, file = ["-r", "__ns:=/one"], {}, PARAMETER_FILES / f"{name}.yaml"
    if file.exists():
        words += ["--params-file", str(file), "-r", "diagnostics:=/diagnostics"]
        wrong = {"rovr": "lsr1", "use_sim_time": False}
    kinds = [kind for kind in vars(MODULES[name]).values() if isinstance(kind, type)]
    (kind,) = [kind for kind in kinds if issubclass(kind, Node) and ".nodes." in kind.__module__]
    node = ros.start(kind, ["--ros-args", *words], **wrong)
    assert node.get_fully_qualified_name() == f"/one/{name}"
    if file.exists():
        for key, value in yaml.safe_load(file.read_text())["/**"]["ros__parameters"].items():
            assert node.get_parameter(key).value == value
        err = capfd.readouterr().err
        assert err.count("parameter rovr does not exist and is ignored; the nearest is rover") == 1
        assert err.count("does not exist") == 1 and not node.has_parameter("rovr")

    def names() -> set[str]:
        found = set()
        for kind in ("publisher", "subscriber", "service", "client"):
            ask = getattr(node, f"get_{kind}_names_and_types_by_node")
            found |= {topic for topic, _ in ask(name, "/one") if not OF_ROS.match(topic)}
        return found

    told = set(re.findall(r"[~/]?[a-z_/]+", PROGRAMS[name].topics))
    told -= {"subscribes", "serves", "publishes", "calls", ""}
    told = {re.sub(r"^~", name, topic) for topic in told}
    told = {"/diagnostics" if topic == "diagnostics" else f"/one/{topic}" for topic in told}
    # Topics that need follow_commands, --drive, grid_map_msgs or hazard_map are in the help only.
    hazards = {f"/one/traverse_server/hazard_map/{which}" for which in ("worst", "best")}
    commands = {"/one/cmd_vel", "/one/traction_controller/commands", "/one/elevation_map"}
    commands |= {"/one/path"}
    optional = (commands | hazards) & told
    wait_until(lambda: told - optional <= names(), f"{told - optional}")
    assert names() <= told | {"/tf"}
