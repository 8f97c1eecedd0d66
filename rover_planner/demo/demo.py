# SPDX-License-Identifier: Apache-2.0
"""The demo: runs a traverse_server and a mission planner in separate processes.

It works as a user's system does: it publishes a map over DDS to a running server, and a mission
planner queries several goals. The answers are shown in a table and a picture. All verdicts in the
table come from the service. The candidate paths in the picture are recomputed in this process.
"""

import dataclasses
import json
import os
import random
import socket
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table
from rich.text import Text

import rover_planner
from rover_physics.files.user_file import open_without_waiting
from rover_physics.files.validation import show_file
from rover_physics.rover.model import Rover
from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, load_terrain, save_terrain
from rover_planner.demo.child_process import ChildProcess, stopping_children
from rover_planner.demo.goals import Mission, Pose, choose_mission
from rover_planner.errors import DemoError, PlanningError
from rover_planner.maps.known_map import describe_terrain
from rover_planner.planning.path_query import PathAnswer, add_path
from rover_planner.planning.search.judge import PathJudge
from rover_planner.planning.search.path_search import find_path
from rover_planner.planning.search.query import SearchQuery, Site
from rover_planner.shell.extras import need
from rover_planner.shell.progress import Steps
from rover_planner.shell.run_program import EXIT_OK
from rover_planner.worlds.mars_terrain import make_mars_terrain

COMPILER = "rover_physics.warm_up"
"""Module that compiles the kernels when it is run."""
SERVER, PLANNER = "rover_planner.nodes.traverse_server", "rover_planner.nodes.mission_planner"
"""Modules of the two nodes."""
MAX_GAP = 0.2
"""Default width up to which unknown regions of the map are interpolated [m]."""
ANSWER_COLUMNS = (
    ("length\n[m]", "length", 2),
    ("time\n[s]", "time", 0),
    ("energy\n[J]", "energy", 1),
    ("smallest\ntip-over\nmargin", "min_tip_over_ratio", 2),
    ("highest\nfriction\nuse", "max_friction_utilisation", 2),
    ("highest\ntorque\nuse", "max_torque_saturation", 2),
    ("highest\nload [N]", "max_wheel_load", 1),
)
"""Columns of numbers: heading, key of the answer, digits after the point."""


def run_demo(
    map_name: str | None,
    picture: Path,
    rover_name: str = "lsr1",
    seed: int = 1,
    max_gap: float = MAX_GAP,
) -> list[dict[str, Any]]:
    """Run the demo, print a table of the answers and write a picture.

    Args:
        map_name: Preset or elevation map, .npz; None generates a Mars-like terrain and saves it
            in the picture's folder.
        picture: Picture to write; the logs are written to its folder.
        rover_name: Preset's name or rover file.
        seed: Seed of the terrain and the goals.
        max_gap: Widest unknown region of the map that is interpolated [m]; 0: none.

    Returns:
        The server's verdict on each goal.

    Raises:
        PlanningError, RoverError: Bad input, or ROS 2 or matplotlib is missing.
        DemoError: A process failed.
    """
    steps = Steps()
    need("rclpy", "the demo")
    need("matplotlib", "the picture of the demo")
    _prepare_folder(picture)
    rover = load_rover(rover_name)
    map_name, terrain = _prepare_map(steps, map_name, picture.parent, seed)
    with steps.step(f"interpolate gaps of the map up to {max_gap:g} m wide") as status:
        ground = _as_the_server_knows_it(terrain, max_gap)
        status.update(f"{status.status}: {np.isfinite(ground.elevation).mean():.0%} known")
    mission, environment = choose_mission(ground, rover, seed), _environment()
    with stopping_children() as children:

        def start(module: str, arguments: Sequence[str] = ()) -> ChildProcess:
            """Start a module; its log has its name."""
            log = picture.parent / f"{module.rpartition('.')[2]}.log"
            children.append(ChildProcess(module, arguments, environment, log))
            return children[-1]

        with steps.step("compile the model's kernels (the first time takes a while)"):
            _expect_success(start(COMPILER))
        server = start(SERVER, _server_parameters(rover_name, max_gap))
        planner = start(PLANNER, _planner_options(map_name, mission))
        answers = _ask(steps, server, planner, mission)
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


def _prepare_folder(picture: Path) -> None:
    """Create the picture's folder and check that the picture can be written."""
    if picture.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise PlanningError(f"picture {show_file(picture)} must be a .png, .svg or .pdf file")
    try:
        picture.parent.mkdir(parents=True, exist_ok=True)
        with open(picture, "ab", opener=open_without_waiting):
            pass
    except OSError as error:
        raise PlanningError(
            f"cannot write the picture {show_file(picture)}: {error.strerror}"
        ) from None


def _prepare_map(
    steps: Steps, map_name: str | None, folder: Path, seed: int
) -> tuple[str, Terrain]:
    """Load the map, or generate and save one; return its name and terrain."""
    name = str(folder / "terrain.npz") if map_name is None else map_name
    made, loaded = f"make a Mars-like terrain, seed {seed}", f"load the map {escape(name)}"
    with steps.step(made if map_name is None else loaded) as status:
        if map_name is None:
            save_terrain(name, make_mars_terrain(seed))
        terrain = load_terrain(name)
        status.update(f"{status.status}: {describe_terrain(terrain)}")
    return name, terrain


def _as_the_server_knows_it(terrain: Terrain, max_gap: float) -> Terrain:
    """Return the map as the server has it: heights in 32 bits, small gaps interpolated."""
    heights = terrain.elevation.astype(np.float32).astype(np.float64)
    return dataclasses.replace(terrain, elevation=heights).fill_gaps(max_gap)


def _server_parameters(rover_name: str, max_gap: float) -> tuple[str, ...]:
    """Return the command-line arguments that set the server's parameters."""
    values = {"rover": rover_name, "unknown_cells": "interpolate", "max_gap": float(max_gap)}
    return ("--ros-args", *(word for key in values for word in ("-p", f"{key}:={values[key]}")))


def _planner_options(map_name: str, mission: Mission) -> tuple[str, ...]:
    """Return the command-line arguments that name map, start and goals to the mission planner."""
    start, *goals = (
        ",".join(repr(float(value)) for value in pose)
        for pose in (mission.start, *(goal.pose for goal in mission.goals))
    )
    ends = (f"--start={start}", *(f"--goal={goal}" for goal in goals))
    return ("--json", f"--map={map_name}", *ends)


def _environment() -> dict[str, str]:
    """Return the environment of the child processes: an unused DDS domain, localhost only."""
    package_folder = str(Path(rover_planner.__file__).resolve().parents[1])
    search = [package_folder, os.environ.get("PYTHONPATH", "")]
    return os.environ | {
        "PYTHONPATH": os.pathsep.join(part for part in search if part),
        "PYTHONUNBUFFERED": "1",
        "ROS_DOMAIN_ID": str(_free_domain()),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def _free_domain() -> int:
    """Choose a random DDS domain that is unused on this machine.

    The first participant of a domain receives on UDP port 7410 + 250 * domain (DDSI-RTPS 9.6.1.1).
    Domains up to 101 do not overlap the ephemeral ports of Linux. Lower ones are left to robots
    and tests, whose domain may look unused between two of their processes.
    """
    domains = random.sample(range(51, 102), 51)
    for domain in domains:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                probe.bind(("", 7410 + 250 * domain))
            except OSError:
                continue
            return domain
    return domains[0]


def _ask(
    steps: Steps, server: ChildProcess, planner: ChildProcess, mission: Mission
) -> list[dict[str, Any]]:
    """Return the server's verdict on each goal, for which the mission planner asks."""

    def end_together() -> None:
        server.wait()
        planner.terminate()

    threading.Thread(target=end_together, daemon=True).start()
    answers: list[dict[str, Any]] = []
    with steps.step("start traverse_server and find it over DDS") as status:
        assert planner.stdout is not None
        for event in map(json.loads, planner.stdout):
            if event["event"] == "answer":
                answers.append(event["answer"])
            elif event["event"] == "asking":
                goal = mission.goals[event["goal"] - 1]
                status.update(f"ask for goal {goal.name} ({goal.intent})")
            else:
                status.update(event["event"])
        if server.poll() is not None:
            raise _failure_of(server)
        if len(answers) != len(mission.goals):
            _expect_success(planner)
            raise DemoError(f"{len(answers)} of {len(mission.goals)} goals were answered")
        status.update(f"publish the map over DDS and ask for {len(answers)} goals")
    return answers


def _expect_success(child: ChildProcess) -> None:
    """Wait until a child has ended; raise DemoError if it failed."""
    if child.wait() != EXIT_OK:
        raise _failure_of(child)


def _failure_of(child: ChildProcess) -> DemoError:
    """Return the error that tells how a child has ended."""
    return DemoError(
        f"{child.name} ended with code {child.returncode}: {child.last_line()} (see {child.log})"
    )


def _draw(
    steps: Steps, picture: Path, rover: Rover, ground: Terrain, mission: Mission,
    answers: list[dict[str, Any]],
) -> int:  # fmt: skip
    """Draw the picture; return how many verdicts agree with those computed here."""
    with steps.step("draw the picture") as status:
        from rover_planner.demo.answers_picture import draw_answers

        answered = []
        for goal in mission.goals:
            status.update(f"sweep the candidate paths to goal {goal.name} for the picture")
            answer = answer_as_a_server(rover, ground, mission.start, goal.pose)
            answered.append((goal, answer))
        status.update("draw the picture")
        passable = sum(answer.traversable for _, answer in answered)
        title = f"{rover.name}: {passable} of {len(answered)} goals can be reached"
        draw_answers(picture, rover, ground, answered, title)
    return sum(
        own.traversable == answer["traversable"] and own.chosen.verdict.code == answer["code"]
        for (_, own), answer in zip(answered, answers, strict=True)
    )


def answer_as_a_server(rover: Rover, ground: Terrain, start: Pose, goal: Pose) -> PathAnswer:
    """Return the best candidate path, or if all are refused the one that a search finds."""
    site = Site(rover, ground)
    answer = PathJudge(site).search(start, goal)
    if answer.traversable or not ground.contains(*goal[:2]):
        return answer
    found = find_path(SearchQuery(site, start, goal))
    return answer if found.path is None else add_path(answer, found.path, np.array(goal))


def answer_table(rover: Rover, mission: Mission, answers: list[dict[str, Any]]) -> Table:
    """Return a table of the verdicts of a traverse_server, one row per goal.

    Args:
        rover: The rover.
        mission: The goals.
        answers: The verdict on each goal, as mission_planner --json prints it.
    """
    table = Table(
        title=f"Answers of /traverse_server for {rover.name}",
        title_justify="left",
        row_styles=("", "dim"),
        expand=False,
    )
    for heading in ("goal", "verdict", "reason"):
        table.add_column(heading, overflow="fold")
    for heading, _, _ in ANSWER_COLUMNS:
        table.add_column(escape(heading), justify="right", no_wrap=True)
    for goal, answer in zip(mission.goals, answers, strict=True):
        passable = answer["traversable"]
        table.add_row(
            f"{goal.name} {goal.intent}",
            Text("traversable", style="bold blue")
            if passable
            else Text("refused", style="bold red"),
            "" if passable else answer["reason"],
            *(_number(answer.get(key), digits) for _, key, digits in ANSWER_COLUMNS),
        )
    return table


def _number(value: float | None, digits: int) -> str:
    """Format a number; None becomes a dash."""
    return "-" if value is None else f"{value:.{digits}f}"
