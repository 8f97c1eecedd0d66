"""The node programs have help that is true, need ROS only to run, and name wrong words."""

import os
import re
import signal
import subprocess
import sys
import time

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
from support.ros_fixtures import domain_id
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


def run_entry_point(name, *words):
    """Run the entry point of a program in a process that has no ROS."""
    code = (
        "import sys; sys.modules['rclpy'] = None; "
        f"from rover_planner.nodes.start import start_{name}; sys.exit(start_{name}())"
    )
    return subprocess.run(
        [sys.executable, "-c", code, *words],
        env=os.environ | {"PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.parametrize("name", PROGRAMS)
def test_help_comes_without_ros_and_lists_every_parameter(name):
    ended = run_entry_point(name, "--help")
    assert (ended.returncode, ended.stderr) == (0, "")
    program = PROGRAMS[name]
    told = " ".join(ended.stdout.split())
    assert told.startswith(f"Usage: {name} ")
    assert program.what in told and program.topics in told
    for spec in program.parameters:
        assert f" {spec.name}: {spec.type_name}, default " in told
        assert spec.meaning in told
        assert re.search(rf"^ +{spec.name}: {spec.type_name}, ", ended.stdout, re.MULTILINE)
    assert max(map(len, ended.stdout.splitlines())) <= 99


@pytest.mark.parametrize("name", PROGRAMS)
def test_without_ros_a_program_says_in_one_line_what_to_install(name):
    ended = run_entry_point(name)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.count("\n") == 1
    assert ended.stderr.startswith(f"{name}: ")
    assert "pip install 'rover_planner[ros]'" in ended.stderr


def run_with(code, name, folder=REPOSITORY):
    """Run the entry point of a program after `code`, with a folder first on Python's path."""
    code = (
        f"import sys; {code}from rover_planner.nodes.start import start_{name} as s; sys.exit(s())"
    )
    return subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": f"{folder}{os.pathsep}{REPOSITORY}"},
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_ros_that_this_python_cannot_import_is_named_in_one_line(name, tmp_path):
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").write_text("import rclpy.built_for_another_python")
    ended = run_with("", name, tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith(f"{name}: ") and ended.stderr.count("\n") == 1
    assert "cannot import rclpy.built_for_another_python" in ended.stderr
    assert "pip install 'rover_planner[ros]'" in ended.stderr


@pytest.mark.parametrize(
    ("module", "said"),
    [("diagnostic_msgs", "cannot import diagnostic_msgs"), ("osqp", "pip install osqp")],
)
def test_a_part_that_is_missing_is_named_in_one_line(module, said):
    ended = run_with(f"sys.modules[{module!r}] = None; ", "traverse_server")
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1)
    assert said in ended.stderr


def test_what_a_plain_installation_brings_is_known_by_its_modules():
    required = {
        re.match(r"[\w-]+", line)[0].lower() for line in setup_arguments()["install_requires"]
    }
    assert {package.lower() for package in PLAIN.values()} == required


SIGNAL_AT_IMPORT = """
import os
class Signal:
    def find_spec(self, name, path=None, target=None):
        if name == "rover_planner.nodes.{name}":
            os.kill(os.getpid(), {number})
sys.meta_path.insert(0, Signal())
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("name", PROGRAMS)
def test_a_signal_ends_a_program_cleanly_while_it_is_imported(name, how):
    ended = run_with(SIGNAL_AT_IMPORT.format(name=name, number=int(how)), name)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


@pytest.mark.parametrize("name", PROGRAMS)
def test_help_comes_before_anything_is_started(name, capfd):
    assert MAINS[name](["--help"]) == 0
    told = capfd.readouterr()
    assert told.out.startswith(f"Usage: {name} ") and told.err == ""


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
    node = ros.spin(NODES[name](context=ros.context, parameter_overrides=wrong))
    assert not node.has_parameter("rovr")
    err = capfd.readouterr().err
    assert err.count("parameter rovr does not exist and is ignored; the nearest is rover") == 1
    assert err.count("parameter zzz does not exist and is ignored; --help lists") == 1


@pytest.mark.parametrize("name", [name for name in PROGRAMS if PROGRAMS[name].parameters])
def test_parameters_that_exist_are_not_warned_of(name, ros, capfd):
    right = [Parameter("rover", value="m2020"), Parameter("use_sim_time", value=False)]
    ros.spin(NODES[name](context=ros.context, parameter_overrides=right))
    assert "does not exist" not in capfd.readouterr().err


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


@pytest.fixture
def start_program():
    """Return a function that starts a node program in a process of its own."""
    started = []

    def start_one(name, *words):
        process = subprocess.Popen(
            [sys.executable, "-m", f"rover_planner.nodes.{name}", *words],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain_id()), "PYTHONUNBUFFERED": "1"},
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
        return process

    yield start_one
    for process in started:
        process.kill()
        process.communicate()


def read_until_ready(process):
    """Return the lines that a program logs until it says that it is ready."""
    lines = []
    for line in process.stderr:
        lines.append(line)
        if "ready" in line:
            return lines
    raise AssertionError(f"ended with {process.wait()}: {''.join(lines)}")


@pytest.mark.slow
def test_a_misspelt_parameter_of_the_command_line_is_warned_of(start_program):
    process = start_program("traverse_server", "--ros-args", "-p", "terain_file:=spirit")
    lines = read_until_ready(process)
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode == 0
    warning = "terain_file does not exist and is ignored; the nearest is terrain_file"
    assert sum(warning in line for line in lines) == 1
    assert lines[-1].rstrip().endswith("ready for rover lsr1, no map yet")


def test_ready_says_which_map_there_is(start_server, capfd):
    start_server(terrain_file="spirit")
    told = "ready for rover lsr1, map spirit: 434 x 400 cells of 0.03 m, 44.8 % known"
    assert told in capfd.readouterr().err


def test_every_program_is_installed_by_its_entry_point():
    scripts = console_scripts()
    for name in PROGRAMS:
        assert scripts[name] == (start.__name__, f"start_{name}")


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_a_simulator_that_is_told_to_end_while_it_publishes_ends_cleanly(how, start_program):
    words = ["--ros-args", "-p", "terrain_file:=spirit", "-p", "start_x:=-46.0"]
    words += ["-p", "start_y:=-19.5", "-p", "rate:=500.0", "-p", "map_rate:=20.0"]
    process = start_program("rover_simulator", *words)
    read_until_ready(process)
    time.sleep(1.0)
    for _ in range(3):  # launch and the terminal both send one
        process.send_signal(how)
        time.sleep(0.01)
    _, err = process.communicate(timeout=60)
    assert (process.returncode, "Traceback" in err) == (0, False), err
