"""The demo: a traverse_server and a mission planner in processes of their own, and their answers.

It does what a user's system would: a map goes over DDS to a running server, a mission planner asks
it for several goals, and the answers make a table and a picture. Every verdict in the table comes
from the service; the picture's candidate paths are computed again here by the same model.
"""

import dataclasses
import importlib.util
import json
import os
import random
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape

from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain, save_terrain
from rover_planner.demo.child_process import ChildProcess, stopping_children
from rover_planner.demo.mission_report import answer_table
from rover_planner.errors import DemoError, PlanningError
from rover_planner.planning.goals import Mission, choose_mission
from rover_planner.progress import Steps
from rover_planner.shell.exit_codes import EXIT_NOT_TRAVERSABLE, EXIT_OK
from rover_planner.worlds.mars_terrain import make_mars_terrain

TERRAIN_SIZE = 24.0
"""Width of the terrain that is made where no map is given [m]."""
MAX_GAP = 0.2
"""Widest unknown region of the map that is interpolated by default [m]."""


def run_demo(
    map_name: str | None,
    picture: Path,
    rover_name: str = "lsr1",
    seed: int = 1,
    max_gap: float = MAX_GAP,
    size: float = TERRAIN_SIZE,
) -> list[dict[str, Any]]:
    """Run the demo; print a table of the answers and write a picture of them.

    Args:
        map_name: Preset or elevation map, .npz; None makes a Mars-like terrain and saves it
            beside the picture.
        picture: Picture to write; logs go beside it.
        rover_name: Preset's name or rover file.
        seed: Seed of the terrain and the goals.
        max_gap: Widest unknown region of the map that is interpolated [m]; 0 refuses all.
        size: Width of the terrain that is made [m].

    Returns:
        The server's verdict on each goal.

    Raises:
        PlanningError, RoverError: Bad input.
        DemoError: ROS 2 is missing, or a process failed.
    """
    steps = Steps()
    _check_environment()
    _prepare_folder(picture)
    rover = load_rover(rover_name)
    map_name, terrain = _prepare_map(steps, map_name, picture.parent, seed, size)
    with steps.step(f"interpolate gaps of the map up to {max_gap:g} m wide") as status:
        ground = _as_the_server_knows_it(terrain, max_gap)
        status.update(f"{status.status}: {np.isfinite(ground.elevation).mean():.0%} known")
    mission = choose_mission(ground, rover, seed)
    environment = _environment()
    parameters = _server_parameters(rover_name, max_gap)
    with stopping_children() as children:
        _compile(steps, children, environment, picture.parent)
        answers = _ask_server(
            steps, children, environment, picture.parent, parameters, map_name, mission
        )
        with steps.step("stop the server and the mission planner"):
            for child in reversed(children):
                child.stop()
    agreeing = _draw(steps, picture, rover, ground, mission, answers)
    steps.console.print(answer_table(rover, mission, answers))
    steps.console.print(
        f"{agreeing} of {len(answers)} verdicts found again by the same model in this process.\n"
        f"Picture: {picture}   map: {map_name}   log: {picture.parent / 'traverse_server.log'}",
        soft_wrap=True,
    )
    return answers


def _check_environment() -> None:
    """Refuse to start where ROS 2 or matplotlib is missing."""
    for module, what in (
        ("rclpy", "ROS 2 Jazzy"),
        ("nav_msgs", "nav_msgs"),
        ("matplotlib", "matplotlib"),
    ):
        if importlib.util.find_spec(module) is None:
            raise DemoError(
                f"the demo needs {what}, which is not there: source ROS 2, or pip install .[all]"
            )


def _prepare_folder(picture: Path) -> None:
    """Make the folder of the picture, and see that the picture can be written."""
    if picture.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise PlanningError(f"picture {picture} must be a .png, .svg or .pdf file")
    try:
        picture.parent.mkdir(parents=True, exist_ok=True)
        with open(picture, "ab"):
            pass
    except OSError as error:
        raise PlanningError(f"cannot write the picture {picture}: {error.strerror}") from None


def _prepare_map(
    steps: Steps, map_name: str | None, folder: Path, seed: int, size: float
) -> tuple[str, Terrain]:
    """Load the map, or make one and save it; return its name too."""
    if map_name is not None:
        with steps.step(f"load the map {escape(map_name)}") as status:
            terrain = load_terrain(map_name)
            status.update(f"{status.status}: {_describe(terrain)}")
        return map_name, terrain
    with steps.step(f"make a Mars-like terrain, seed {seed}") as status:
        path = folder / "terrain.npz"
        save_terrain(path, make_mars_terrain(seed, size))
        terrain = load_terrain(path)
        status.update(f"{status.status}: {_describe(terrain)}")
    return str(path), terrain


def _describe(terrain: Terrain) -> str:
    """Return size, resolution and known share of a terrain."""
    xmin, xmax, ymin, ymax = terrain.bounds
    known = np.isfinite(terrain.elevation).mean()
    return (
        f"{xmax - xmin:.1f} x {ymax - ymin:.1f} m, cells of {100 * terrain.resolution:.1f} cm, "
        f"{known:.0%} known"
    )


def _as_the_server_knows_it(terrain: Terrain, max_gap: float) -> Terrain:
    """Return the map as it arrives over DDS, its heights 32-bit numbers, and with gaps filled."""
    heights = terrain.elevation.astype(np.float32).astype(np.float64)
    return dataclasses.replace(terrain, elevation=heights).fill_gaps(max_gap)


def _server_parameters(rover_name: str, max_gap: float) -> tuple[str, ...]:
    """Return the words that give the server its parameters."""
    values = {"rover": rover_name, "unknown_cells": "interpolate", "max_gap": float(max_gap)}
    return ("--ros-args", *(word for key in values for word in ("-p", f"{key}:={values[key]}")))


def _environment() -> dict[str, str]:
    """Return the environment of the child processes: a DDS domain of their own on this machine."""
    package_folder = str(Path(__file__).resolve().parent.parent)
    search = [package_folder, os.environ.get("PYTHONPATH", "")]
    return os.environ | {
        "PYTHONPATH": os.pathsep.join(part for part in search if part),
        "PYTHONUNBUFFERED": "1",
        "ROS_DOMAIN_ID": str(_free_domain()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def _free_domain() -> int:
    """Choose a random DDS domain that nobody on this machine uses.

    The first participant of a domain receives on UDP port 7410 + 250 * domain (DDSI-RTPS 9.6.1.1).
    Domains up to 101 stay clear of the ports that Linux gives out.
    """
    domains = random.sample(range(1, 102), 101)
    for domain in domains:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7410 + 250 * domain))
            except OSError:
                continue
            return domain
    return domains[0]


def _compile(steps: Steps, children: list, environment: dict[str, str], folder: Path) -> None:
    """Compile the kernels in a process that can be stopped at any time."""
    with steps.step("compile the model's kernels (the first time takes a while)"):
        child = ChildProcess(
            "rover_physics.prediction.sweep", (), environment, folder / "compile_kernels.log"
        )
        children.append(child)
        for _ in child.lines(lambda: None):
            pass
        _expect_success(child)


def _ask_server(
    steps: Steps,
    children: list,
    environment: dict[str, str],
    folder: Path,
    parameters: tuple[str, ...],
    map_name: str,
    mission: Mission,
) -> list[dict[str, Any]]:
    """Start the server and the mission planner; return the verdict on each goal."""
    with steps.step("start traverse_server and find it over DDS") as status:
        server = ChildProcess(
            "rover_planner.nodes.traverse_server",
            parameters,
            environment,
            folder / "traverse_server.log",
        )
        children.append(server)
        planner = ChildProcess(
            "rover_planner.nodes.mission_planner",
            ["--json", f"--map={map_name}", f"--start={_join(mission.start)}"]
            + [f"--goal={_join(goal.pose)}" for goal in mission.goals],
            environment,
            folder / "mission_planner.log",
        )
        children.append(planner)
        events = _events(planner, server)
        _skip_to(events, "publishing the map", planner)
        status.update("publish the map over DDS")
        _skip_to(events, "asking", planner)
    answers: list[dict[str, Any]] = []
    with steps.step(f"ask for {len(mission.goals)} goals") as status:
        for event in events:
            if event["event"] == "answer":
                answers.append(event["answer"])
            else:
                goal = mission.goals[event["goal"] - 1]
                status.update(f"ask for goal {goal.name} ({goal.intent})")
        status.update(f"asked for {len(answers)} goals over DDS")
    _expect_success(planner, (EXIT_OK, EXIT_NOT_TRAVERSABLE))
    if len(answers) != len(mission.goals):
        raise DemoError(f"{len(answers)} of {len(mission.goals)} goals were answered")
    return answers


def _join(pose) -> str:
    return ",".join(repr(float(value)) for value in pose)


def _events(planner: ChildProcess, server: ChildProcess) -> Iterator[dict[str, Any]]:
    """Yield what the mission planner reports, as long as the server is alive."""

    def watch() -> None:
        if not server.running:
            raise DemoError(
                f"{server.name} ended with code {server.exit_code}: {server.last_words()} "
                f"(see {server.log})"
            )

    for line in planner.lines(watch):
        yield json.loads(line)


def _skip_to(events: Iterator[dict[str, Any]], name: str, planner: ChildProcess) -> None:
    """Read the planner's events up to the first of a name."""
    if not any(event["event"] == name for event in events):
        _expect_success(planner)
        raise DemoError(f"{planner.name} ended before {name}")


def _expect_success(child: ChildProcess, codes: tuple[int, ...] = (EXIT_OK,)) -> None:
    """Wait until a child has ended, and refuse to go on if its exit code is another."""
    while child.running:
        time.sleep(0.02)
    if child.exit_code not in codes:
        raise DemoError(
            f"{child.name} ended with code {child.exit_code}: {child.last_words()} "
            f"(see {child.log})"
        )


def _draw(
    steps: Steps,
    picture: Path,
    rover: Rover,
    ground: Terrain,
    mission: Mission,
    answers: list[dict[str, Any]],
) -> int:
    """Draw the picture; return how many verdicts the model gave here as well."""
    with steps.step("draw the picture") as status:
        from rover_planner.figures.plots import LabelledAnswer, draw_answers
        from rover_planner.planning.path_query import answer_path_query

        labelled = []
        for goal in mission.goals:
            status.update(f"sweep the candidate paths to goal {goal.name} for the picture")
            answer = answer_path_query(rover, ground, mission.start, goal.pose)
            labelled.append(LabelledAnswer(goal.name, goal.intent, answer))
        status.update("draw the picture")
        passable = sum(one.answer.traversable for one in labelled)
        title = f"{rover.name}: {passable} of {len(labelled)} goals can be reached"
        draw_answers(picture, rover, ground, labelled, title)
    return sum(
        one.answer.traversable == answer["traversable"]
        and one.answer.chosen.verdict.code == answer["code"]
        for one, answer in zip(labelled, answers, strict=True)
    )
