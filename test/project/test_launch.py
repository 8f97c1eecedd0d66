# SPDX-License-Identifier: Apache-2.0
"""Launch, parameter and Nav2 files and layouts name nodes, parameters and topics that exist."""

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest
import yaml

from rover_physics import load_rover
from rover_physics.names import SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.rover.rover_file import preset_names
from rover_physics.rover.steering_joints import steering_joints
from rover_physics.rover.urdf.write_urdf import write_urdf
from rover_planner.nodes.start import PROGRAMS
from support.project.checkout import TOP, console_scripts
from support.project.launch_files import describe, start_rover

CONFIG = TOP / "config"
PARAMETER_FILES = sorted((CONFIG / "parameters").glob("*.yaml"))
FOR_NAV2 = CONFIG / "nav2" / "watch.yaml"
LAYOUTS = sorted((CONFIG / "views").iterdir())
OF_OTHERS = {"robot_description", "diagnostics"}
"""Topics in layouts that are not published by a node under its own help's name."""


def check_parameters(node: str, values: dict[str, Any]) -> None:
    """Hold parameters against the table of their node; every node has use_sim_time."""
    specs = {spec.name: spec for spec in PROGRAMS[node].parameters}
    for name, value in values.items():
        if name == "use_sim_time":
            continue
        assert name in specs, f"{node} has no parameter {name}"
        specs[name].check(tuple(value) if isinstance(value, list) else value)


def test_the_rover_starts_as_its_parameter_files_say_and_expects_the_watch_of_the_server():
    nodes = start_rover()
    assert [node.executable for node in nodes] == ["traverse_server", "traction_controller"]
    for node in nodes:
        assert node.package == "rover_planner" and node.executable in console_scripts()
        file, given = node.parameters
        assert file == str(TOP / "config" / "parameters" / f"{node.executable}.yaml")
        assert Path(file).is_file() and given["use_sim_time"] is False
        assert (node.namespace, node.respawn) == ("", True)
        check_parameters(node.executable, given)
    server, controller = (node.parameters[1] for node in nodes)
    assert server["monitor"] is True and 0.0 < controller["stop_timeout"] < 0.5


def test_arguments_of_the_rover_take_precedence_over_its_files_and_can_leave_out_the_watch():
    server, controller = start_rover(
        namespace="one", use_sim_time="True", respawn="false", rover="m2020",
        terrain_file="spirit", watch="false",
    )  # fmt: skip
    assert server.parameters[1] == {
        "use_sim_time": True, "rover": "m2020", "terrain_file": "spirit",
    }  # fmt: skip
    assert controller.parameters[1] == {"use_sim_time": True, "rover": "m2020"}
    for node in (server, controller):
        assert (node.namespace, node.respawn) == ("one", False)
        assert ("diagnostics", "/diagnostics") in node.remappings
        check_parameters(node.executable, node.parameters[1])
    assert [n.executable for n in start_rover(traction_controller="false")] == ["traverse_server"]
    with pytest.raises(ValueError, match="'maybe' must be true or false"):
        start_rover(respawn="maybe")


def test_the_simulation_is_the_rover_with_a_simulator():
    defaults, (simulator, group), names = describe("simulation.launch.py")
    assert simulator.executable == "rover_simulator"
    file, given = simulator.parameters
    assert file.given[0] == "rover_simulator_parameters"
    assert Path(defaults["rover_simulator_parameters"]).is_file()
    specs = {spec.name: spec for spec in PROGRAMS["rover_simulator"].parameters}
    for name in names["ARGUMENTS"]:
        kind_of = type(specs[name].default)
        assert given[name].value_type is (float if kind_of is float else str)
        assert kind_of(defaults[name]) == specs[name].default
    *remaps, include = group.given[0]
    # Each of two rovers has its own frames, whose names are the same.
    frames = [("/tf", "tf"), ("/tf_static", "tf_static")]
    assert [one.given for one in remaps] == frames == simulator.remappings[1:]
    (source,) = include.given
    assert Path(source.given[0]) == TOP / "launch" / "rover.launch.py"
    passed = dict(include.launch_arguments)
    assert passed.keys() <= describe("rover.launch.py")[0].keys()
    assert passed["terrain_file"] == ""  # the server's map is the simulator's
    file = yaml.safe_load(Path(defaults["traction_controller_parameters"]).read_text())
    assert file["/**"]["ros__parameters"]["enabled_at_start"] is True


@pytest.mark.parametrize("path", [*PARAMETER_FILES, FOR_NAV2], ids=lambda path: path.stem)
def test_a_parameter_file_has_known_parameters_for_any_namespace_and_defaults_of_its_node(path):
    ((pattern, content),) = yaml.safe_load(path.read_text()).items()
    node = "traverse_server" if path == FOR_NAV2 else path.stem.removeprefix("simulated_")
    assert pattern == (node if path == FOR_NAV2 else "/**")
    assert list(content) == ["ros__parameters"]
    check_parameters(node, content["ros__parameters"])
    if path.stem in ("traverse_server", "traction_controller"):  # not for a simulation
        defaults = {spec.name: spec.ros_default for spec in PROGRAMS[node].parameters}
        assert content["ros__parameters"].items() <= defaults.items()


@pytest.mark.parametrize("path", LAYOUTS, ids=lambda path: path.name)
def test_a_layout_shows_topics_that_the_nodes_publish(path):
    text = path.read_text()
    if path.suffix == ".rviz":
        displays = yaml.safe_load(text)["Visualization Manager"]["Displays"]
        found = {d[key]["Value"] for d in displays for key in ("Topic", "Description Topic")
                 if key in d}  # fmt: skip
    else:
        json.loads(text)
        found = set(re.findall(r'"(/[a-z_]+(?:/[a-z_]+)*)[."]', text))
    shown = {name.lstrip("/") for name in found}
    published = set()
    for node, program in PROGRAMS.items():
        for part in program.topics.split("; "):
            if part.startswith("publishes"):
                published |= {re.sub("^~", node, name)
                              for name in re.findall(r"[~/a-z_]+", part)}  # fmt: skip
    assert {"elevation_cloud", "traverse_server/plan", "traverse_server/markers"} <= shown
    assert shown <= published | OF_OTHERS


@pytest.mark.parametrize("preset", preset_names())
def test_ros2_control_has_what_the_urdf_tells_and_the_controller_reads_and_commands(
    preset, tmp_path
):
    urdf = tmp_path / "rover.urdf"
    write_urdf(urdf, load_rover(preset), "mock_components/GenericSystem")
    system = ElementTree.parse(urdf).getroot().find("ros2_control")
    commands = {
        (joint.get("name"), one.get("name"))
        for joint in system.findall("joint") for one in joint.findall("command_interface")
    }  # fmt: skip
    file = yaml.safe_load((CONFIG / "ros2_control" / "controllers.yaml").read_text())
    anywhere = "/**/"  # the spawner refuses a file of the root namespace in another one
    values = {
        name.removeprefix(anywhere): part["ros__parameters"]
        for name, part in file.items() if name.startswith(anywhere)
    }  # fmt: skip
    for group in ("wheel_efforts", "wheel_velocities", "steering_positions"):
        joints, interface = values[group]["joints"], values[group]["interface_name"]
        assert {(joint, interface) for joint in joints} <= commands
    assert tuple(values["wheel_efforts"]["joints"]) == WHEEL_JOINTS  # the controller's order
    assert values["steering_positions"]["joints"] == list(steering_joints(load_rover(preset)))
    assert values["imu_broadcaster"]["sensor_name"] == system.find("sensor").get("name")
    controller = {spec.name: spec.default for spec in PROGRAMS["traction_controller"].parameters}
    assert values["imu_broadcaster"]["frame_id"] == controller["base_frame"]
    measured = {joint.get("name") for joint in system.findall("joint")}
    assert {*SUSPENSION_JOINTS, *WHEEL_JOINTS} <= measured

    *_, control, spawner = nodes = start_rover(urdf=str(urdf))
    assert [node.executable for node in nodes[:3]] == [
        "traverse_server", "traction_controller", "robot_state_publisher",
    ]  # fmt: skip
    assert control.parameters == [str(CONFIG / "ros2_control" / "controllers.yaml")]
    spawned = set(spawner.arguments) & values.keys() | {"joint_state_broadcaster"}
    assert spawned <= set(values["controller_manager"])
    said = PROGRAMS["traction_controller"].topics
    for ours, theirs in nodes[1].remappings[1:]:
        assert ours in re.findall(r"[~/a-z_]+", said) and theirs.split("/")[0] in spawned


NAV2 = {
    bool: {"enabled", "rolling_window", "track_unknown_space", "trinary_costmap",
           "map_subscribe_transient_local", "subscribe_to_updates"},
    int: {"type", "lethal_cost_threshold", "unknown_cost_value"},
    float: {"base", "multiplier"},
    str: {"global_frame", "robot_base_frame", "plugin", "map_topic", "mask_topic",
          "filter_info_topic"},
    list: {"plugins", "filters"},
}  # fmt: skip
"""Parameters of Nav2 1.3.13 (Jazzy) by their type, as its sources have them: it is not on PyPI."""


def leaves_of(content):
    """Yield name and value of all parameters."""
    for name, value in content.items():
        yield from leaves_of(value) if isinstance(value, dict) else [(name, value)]


@pytest.mark.parametrize("file", ["hazard_layer.yaml", "hazard_filter.yaml"])
def test_the_files_for_nav2_have_its_parameters_and_read_the_topic_of_the_server(file):
    text = (CONFIG / "nav2" / file).read_text(encoding="utf-8")
    content = yaml.safe_load(text)
    costmap = content["global_costmap"]["global_costmap"]["ros__parameters"]
    (name,) = costmap.get("plugins") or costmap["filters"]
    plugins = "nav2_costmap_2d::StaticLayer", "nav2_costmap_2d::KeepoutFilter"
    assert costmap[name]["plugin"] in plugins
    assert {one for one, value in leaves_of(content) if one not in NAV2[type(value)]} == set()
    (read,) = re.findall(r"\b(?:map|mask)_topic: (\S+)", text)
    said = PROGRAMS["traverse_server"].topics.replace("~", "/traverse_server")
    assert read in said.split("publishes")[1]
    assert len(set(re.findall(r"\bfilter_info_topic: (\S+)", text))) <= 1
