# SPDX-License-Identifier: Apache-2.0
"""The node /mission_planner: queries a traverse_server over ROS 2 for a list of goals.

    mission_planner [--map TERRAIN] --start X,Y,YAW --goal X,Y,YAW [--goal ...]
                    [--drive] [--advise] [--json]

A client to copy from is examples/06_ask_the_server_over_ros.py.
"""

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import rclpy
from rclpy.exceptions import ParameterException

from rover_physics.terrain.grid import Terrain, load_terrain
from rover_planner.errors import DriveFailedError, NoAnswerError, PlanningError
from rover_planner.nodes.mission.client import NODE_NAME, Answer, MissionPlanner
from rover_planner.nodes.mission.drive import Drive, DriveSettings
from rover_planner.nodes.start import MissionOptions, read_arguments
from rover_planner.ros.process import init_ros
from rover_planner.shell.poses import Pose
from rover_planner.shell.run_program import (
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    EXIT_NOT_TRAVERSABLE,
    EXIT_OK,
    run_program,
)

OWN_OPTIONS = {"policy", "backward"}
"""Options of a remedy that a mission planner can see to: the server's torque policy, and the
direction, which is that of the path. Arm and payload are others' work."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the node and return its exit code; see `rover_planner.nodes.start`."""
    return run_program(NODE_NAME, lambda: _run(argv))


def _run(argv: Sequence[str] | None) -> int:
    options = read_arguments(NODE_NAME, argv)
    if options == EXIT_OK:  # help was printed
        return EXIT_OK
    terrain = load_terrain(options.map_name) if options.map_name else None
    init_ros(argv)
    node = None
    try:
        node = MissionPlanner(options.map_frame, options.timeout)
        return _carry_out(node, terrain, options)
    except ParameterException as error:  # ROS has parameters of its own
        raise PlanningError(str(error)) from error
    except Exception:
        if rclpy.ok():
            raise
        return EXIT_INTERRUPTED  # a signal has shut ROS down, where calls of it fail then
    finally:
        rclpy.try_shutdown()
        if node is not None:
            node.destroy_node()


def _carry_out(planner: MissionPlanner, terrain: Terrain | None, options: MissionOptions) -> int:
    """Publish the map and query each goal; return the exit code."""
    tell = partial(_tell, options.as_json, 0)
    tell("waiting for the server")
    planner.wait_for_server()
    if terrain is not None:
        tell("publishing the map")
        planner.publish_map(terrain)
    codes: set[int] = set()
    start: Sequence[float] = options.start
    for number, goal in enumerate(options.goal, start=1):
        tell = partial(_tell, options.as_json, number)
        tell("asking")
        asked = time.monotonic()
        answer = planner.ask(start, goal)
        timed = answer.report | {"response_time": time.monotonic() - asked}
        tell("answer", replace(answer, report=timed))
        if options.advise and answer.was_judged and not answer.traversable:
            answer = _take_advice(planner, start, goal, tell) or answer
        codes.add(_exit_code(answer))
        if options.drive and answer.traversable:
            tell("driving")
            settings = DriveSettings(options.position_tolerance, options.heading_tolerance)
            drive = Drive(planner, goal, settings, tell)
            try:
                start = drive.run(answer.poses).tolist()
            except NoAnswerError as error:
                raise DriveFailedError(str(error)) from error
            tell("arrived")
    return next(code for code in (EXIT_FAILED, EXIT_NOT_TRAVERSABLE, EXIT_OK) if code in codes)


def _take_advice(
    planner: MissionPlanner, start: Sequence[float], goal: Pose, tell: Callable[..., None]
) -> Answer | None:
    """Take the first remedy that needs nobody else; return the answer with it, None without."""
    advice = planner.ask_advice()
    for remedy in advice["remedies"]:
        if remedy["needs_others"] or not set(remedy["options"]) <= OWN_OPTIONS:
            continue
        tell(f"advice: {remedy['words']}")
        if "policy" in remedy["options"]:
            planner.set_policy(remedy["options"]["policy"])
        has_path = "poses" in remedy
        answer = planner.check(np.array(remedy["poses"])) if has_path else planner.ask(start, goal)
        tell("answer", answer)
        return answer
    words = advice.get("words", advice["reason"])
    tell(f"advice: none that a mission planner can take; {words}")
    return None


def _tell(as_json: bool, goal: int, event: str, answer: Answer | None = None) -> None:
    """Print an event about a goal, 0 for none; such as an answer."""
    if as_json:
        about = {"goal": goal} if goal else {}
        told = {} if answer is None else {"answer": answer.report}
        print(json.dumps({"event": event} | about | told), flush=True)
    elif answer is not None:
        no = "no" if answer.was_judged else "not judged"
        word = "yes" if answer.traversable else f"{no}, {answer.reason}"
        print(f"goal {goal}: {word}", flush=True)
    elif event != "asking":
        print(event, flush=True)


def _exit_code(answer: Answer) -> int:
    """Return the exit code of one answer."""
    if answer.traversable:
        return EXIT_OK
    return EXIT_NOT_TRAVERSABLE if answer.was_judged else EXIT_FAILED


if __name__ == "__main__":
    sys.exit(main())
