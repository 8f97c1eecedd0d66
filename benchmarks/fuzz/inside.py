"""Throws hostile messages at the adapters and services in this process."""

import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.fuzz.hostile import ARM_JOINTS, EDGE, HostileMaker
from benchmarks.fuzz.tally import REFUSED, TAKEN, Tally, memory_of
from msg_adapters.commands import twist_to_speeds
from msg_adapters.elevation import terrain_from_point_cloud
from msg_adapters.errors import MessageError
from msg_adapters.frames import check_frame
from msg_adapters.imu import imu_to_attitude
from msg_adapters.joints import joint_positions, joint_velocities
from msg_adapters.odometry import odometry_to_pose
from msg_adapters.paths import path_to_poses, stamped_pose_to_array
from msg_adapters.results.verdicts import report_to_json
from msg_adapters.tools import target_to_point, wrench_to_force_and_moment
from rover_physics.names import STEERING_JOINTS, SUSPENSION_JOINTS, WHEEL_JOINTS
from rover_physics.terrain.grid import Terrain
from rover_physics.warm_up import warm_up
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.reach_query import ReachQuery
from rover_planner.planning.answering.service_settings import load_service_settings
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.ros.refusals import INPUT_ERRORS
from rover_planner.traction.prepared_map import prepare_map
from rover_planner.traction.settings import load_traction_settings
from rover_planner.traction.traction_service import TractionService

TOO_LONG = 10.0
"""Time for one input above which it counts as a hang [s]."""
BATCH = 200
"""Inputs between two probes."""
MAX_GROWTH = 400.0
"""Largest growth of the memory in use [MB]."""
RESOLUTIONS = (0.0, 0.0, 0.05)
START, GOAL = (-1.0, 0.0, 0.0), (1.0, 0.1, 0.0)


def good_ground() -> Terrain:
    """Return gentle waves that end at an edge, over which a rover cannot drive back."""
    along = 0.05 * np.arange(121) - 3.0
    heights = 0.02 * np.sin(2.0 * along)[:, None] - np.where(along < EDGE, 0.0, 0.09)
    friction = np.tile(np.where(along < EDGE, 0.8, 0.4), (len(along), 1))
    return Terrain(heights, 0.05, (-3.0, -3.0), friction=friction)


STOWED = dict(zip(ARM_JOINTS, (3.14159, -0.2, 0.2), strict=True))
"""Angles of the stowed arm of LSR-1 [rad]."""


class PlannerTarget:
    """A traverse service with a good map; takes messages as the server does."""

    def __init__(self) -> None:
        self.service = TraverseService(load_service_settings(TraverseServerParameters()))
        self.reach = ReachQuery()
        self._ground = good_ground()
        self.reset()
        self._answer = self._ask()

    def reset(self) -> None:
        """Take the good map again and no path."""
        self.service.take_terrain(self._ground)
        self.service.refuse_path("none")

    def probe(self) -> str:
        """Return what is wrong with the answer to a known question; empty if nothing is."""
        return "" if self._ask() == self._answer else "another answer to the same question"

    def take(self, kind: str, message: Any, resolution: float) -> None:
        """Take a message and answer what it asks."""
        take: dict[str, Callable[[], object]] = {
            "cloud": lambda: self._take_cloud(message, resolution),
            "path": lambda: self._take_path(message),
            "plan": lambda: self._plan(message),
            "joint_states": lambda: self._take_joints(message),
            "tool_target": lambda: self._take_target(message),
            "tool_wrench": lambda: self.reach.take_wrench(
                *wrench_to_force_and_moment(message, "map")
            ),
        }
        take[kind]()

    def _take_cloud(self, cloud: Any, resolution: float) -> None:
        before = self.service.terrain
        try:
            check_frame(cloud.header.frame_id, "map", "elevation_cloud")
            self.service.take_terrain(terrain_from_point_cloud(cloud, resolution))
        except INPUT_ERRORS:
            assert self.service.terrain is before, "a refused cloud changed the map"
            raise
        self.service.answer(START, GOAL)
        self.reset()

    def _take_path(self, path: Any) -> None:
        self.service.take_path(path_to_poses(path, "map"))
        judgement = self.service.check_last_path()
        report_to_json(judgement.report)

    def _plan(self, request: Any) -> None:
        start = stamped_pose_to_array(request.start, "map", "start")
        goal = stamped_pose_to_array(request.goal, "map", "goal")
        judgement = self.service.answer(start, goal, request.tolerance)
        report_to_json(judgement.report)

    def _take_joints(self, state: Any) -> None:
        self.service.take_joints(joint_positions(state, self.service.joint_names))

    def _take_target(self, target: Any) -> None:
        self.service.take_path(np.zeros((1, 3)))
        self.reach.take_target(target_to_point(target, "map"))
        report_to_json(self.reach.ask(self.service.situation()))

    def _ask(self) -> str:
        self.service.take_joints(dict.fromkeys(SUSPENSION_JOINTS, 0.0) | STOWED)
        judgement = self.service.answer(START, GOAL)
        return report_to_json(judgement.report)


class ControllerTarget:
    """A traction service that keeps updating; takes messages as the controller does."""

    def __init__(self) -> None:
        parameters = TractionControllerParameters()
        self.service = TractionService(load_traction_settings(parameters))
        self._most = self.service.settings.rover.wheel.max_torque
        self._now = 0.0
        self._feed()
        self.service.update(self._now)  # now, so that the time of compilation is none of an input

    def probe(self) -> str:
        """Return the fault that good inputs leave; empty if there is none."""
        self._feed()
        return self.service.update(self._now).fault

    def take(self, kind: str, message: Any, resolution: float) -> None:
        """Take a message among good ones, then update; the torques must be within the limit."""
        self._feed()
        try:
            self._take(kind, message, resolution)
        except MessageError as error:
            self.service.refuse(kind, str(error))
            raise
        finally:
            torques = self.service.update(self._now).torques
            assert (np.abs(torques) <= self._most).all(), f"torques {torques} after {kind}"

    def _feed(self) -> None:
        """Take good inputs, 10 ms later."""
        self._now += 0.01
        joints = dict.fromkeys((*SUSPENSION_JOINTS, *WHEEL_JOINTS, *STEERING_JOINTS), 0.0)
        self.service.take_joints(joints, joints, self._now)
        self.service.take_attitude(0.0, 0.0, np.zeros(3), self._now)
        self.service.take_command(0.02, 0.0, self._now)

    def _take(self, kind: str, message: Any, resolution: float) -> None:
        service, now = self.service, self._now
        if kind == "joint_states":
            positions = joint_positions(message, (*SUSPENSION_JOINTS, *STEERING_JOINTS))
            velocities = joint_velocities(message, (*SUSPENSION_JOINTS, *WHEEL_JOINTS))
            service.take_joints(positions, velocities, now)
        elif kind == "imu":
            attitude = imu_to_attitude(message)
            service.take_attitude(attitude.roll, attitude.pitch, attitude.rates, now)
        elif kind == "cmd_vel":
            service.take_command(*twist_to_speeds(message), now)
        elif kind == "odometry":
            service.take_odometry(*odometry_to_pose(message, "map"), now)
        else:
            terrain = terrain_from_point_cloud(message, resolution)
            service.take_map(prepare_map(service.settings.rover, terrain))


def fuzz_inside(seed: int, count: int) -> Tally:
    """Throw hostile messages at services in this process and return what became of them."""
    warm_up()
    maker, tally = HostileMaker(seed), Tally()
    planner, controller = PlannerTarget(), ControllerTarget()
    targets = (
        *((planner, kind) for kind in ("cloud", "cloud", "path", "path", "plan", "plan",
                                       "joint_states", "tool_target", "tool_wrench")),
        *((controller, kind) for kind in ("cloud", "joint_states", "imu", "odometry", "cmd_vel")),
    )  # fmt: skip
    first = memory_of()
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning on stderr is a defect
        for i in range(count):
            target, kind = targets[maker.rng.integers(len(targets))]
            message = maker.make(kind)
            resolution = float(maker.rng.choice(RESOLUTIONS))
            _throw(lambda: target.take(kind, message, resolution), kind, i, tally)  # noqa: B023
            if i % BATCH == BATCH - 1:
                for probed in (planner, controller):
                    _throw(probed.probe, "probe", i, tally)
    growth = memory_of() - first
    tally.notes.append(f"memory grew by {growth:.0f} MB")
    if growth > MAX_GROWTH:
        tally.defects.append(f"memory grew by more than {MAX_GROWTH:.0f} MB")
    return tally


def _throw(take: Callable[[], Any], kind: str, number: int, tally: Tally) -> None:
    """Run one input and count what became of it."""
    began = time.perf_counter()
    outcome = TAKEN
    try:
        wrong = take()
        if wrong:
            tally.defects.append(f"{kind}: {wrong}")
    except INPUT_ERRORS:
        outcome = REFUSED
    except Exception as error:
        tally.defects.append(f"{kind} (input {number}): {type(error).__name__}: {error}"[:300])
    seconds = time.perf_counter() - began
    if seconds > TOO_LONG:
        tally.defects.append(f"{kind} (input {number}): took {seconds:.1f} s")
    tally.take(kind, outcome, seconds)
