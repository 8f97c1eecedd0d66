# SPDX-License-Identifier: Apache-2.0
"""Watches the accepted path in threads: ~/stop at once and as a heartbeat, and ~/monitor."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from std_msgs.msg import Bool
from std_srvs.srv import SetBool

from msg_adapters.results.diagnostics import MONITOR, make_status
from rover_physics.numerics.interruption import interruptible
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.budget import STOPPING, Budget, QuestionStoppedError
from rover_planner.planning.answering.judgement import PathJudgement, refuse_for
from rover_planner.planning.answering.server_health import Health
from rover_planner.planning.answering.snapshot import Snapshot
from rover_planner.planning.answering.traverse_service import TraverseService
from rover_planner.planning.navigation.monitor import (
    IDLE,
    STOPPED,
    Finding,
    PathMonitor,
    Sight,
    describe_watch,
)
from rover_planner.planning.navigation.watched_path import WatchedPath
from rover_planner.ros.node import RoverNode
from rover_planner.ros.qos import LATCHED_QOS

PERIOD = 0.1
"""Time between two looks while a path is watched, and between two heartbeats [s]."""
LONGEST_LOOK = 2.0
"""Age of the last look above which there is no heartbeat: the watch has died [s]."""
MAX_POSE_AGE = 0.3
"""Age up to which a pose says where the rover is [s]."""
NO_PATH = WatchedPath(np.empty((0, 3)))
"""The path that is watched where none is."""
END_TIME = 2.0
"""Longest wait for the thread at the end [s]."""


class PathWatch:
    """Connects a PathMonitor to a node; looks are taken in a thread, in which maps are judged.

    Another thread sends the heartbeat and nothing else, so that no work of the node delays it.
    It ends when the thread of the looks or the executor hangs: both take part in each look.
    """

    def __init__(
        self,
        node: RoverNode[TraverseServerParameters],
        service: TraverseService,
        find_pose: Callable[[], NDArray[np.float64] | None],
        report_stop: Callable[[PathJudgement, str, Snapshot], None],
    ):
        """Create topic, service and thread.

        Args:
            node: The node.
            service: Knows map, pose and joints.
            find_pose: Returns the pose (3,) x, y [m] and yaw [rad] of the body of just now, map
                frame; None if it is not known.
            report_stop: Publishes why the rover is to stop, with the hash of its path and what was
                known; called in the executor's thread.
        """
        self._node, self._service = node, service
        self._find_pose, self._report_stop = find_pose, report_stop
        self._monitor = PathMonitor()
        self.finding = self._monitor.finding
        """The last finding."""
        self.enabled = False
        """True while accepted paths are watched."""
        self._reported: PathJudgement | None = None
        self._last_path: WatchedPath | None = None
        self._stop = node.create_publisher(Bool, "~/stop", LATCHED_QOS)
        self._state = node.create_publisher(DiagnosticStatus, "~/watch", LATCHED_QOS)
        self._map_age = math.nan
        self._looked = time.monotonic()
        self._stop_is_new = threading.Event()
        self._changed = threading.Condition()
        self._new_path: WatchedPath | None = None
        self._sight: Sight | None = None
        self._life = Budget(math.inf)
        self._thread = threading.Thread(target=self._run, name="monitor", daemon=True)
        self._thread.start()
        node.create_service(SetBool, "~/monitor", self._switch)
        self.apply()
        self._heartbeat = threading.Thread(target=self._send_stops, name="heartbeat", daemon=True)
        self._heartbeat.start()
        assert self._heartbeat.native_id is not None
        node.urgent_threads = (self._heartbeat.native_id,)

    def apply(self) -> None:
        """Follow the parameter `monitor`."""
        if self._node.values.monitor != self.enabled:
            self.enabled = self._node.values.monitor
            self._set_path(self._last_path if self.enabled else NO_PATH)

    def accept(self, poses: NDArray[np.float64], about: str) -> None:
        """Watch a path that was judged traversable, from the next look on.

        Args:
            poses: (n, 3) x, y [m] and yaw [rad] of its waypoints, map frame.
            about: Its hash.
        """
        self._last_path = WatchedPath(poses, about)
        if self.enabled:
            self._set_path(self._last_path)

    def describe(self) -> Health:
        """Return what is watched and what was found, for diagnostics."""
        tolerance = self._service.settings.parameters.suspension_tolerance
        health = describe_watch(self.finding, self.enabled, tolerance)
        return replace(health, values={**health.values, "map_age": f"{self._map_age:.1f} s"})

    @property
    def _stops(self) -> bool:
        """True if the rover is to stop: while paths are watched, it may drive a watched one."""
        return self.enabled and self.finding.state in (IDLE, STOPPED)

    def look(self) -> None:
        """Have a look taken at once, from any thread: there is a new map."""
        if not self.is_idle:
            self._node.handover.call(self.beat)

    def beat(self) -> None:
        """Have a look taken and publish `~/watch`.

        To be called each PERIOD, and each second while the watch is idle: then the suspension is
        compared for the diagnostics.
        """
        self._offer_sight()
        if self._is_alive and self._state.get_subscription_count():
            health, name = self.describe(), self._service.settings.rover.name
            status = make_status(MONITOR, health.level, health.message, health.values, name)
            self._state.publish(status)

    @property
    def is_idle(self) -> bool:
        """True if no path is watched."""
        return not self.enabled or (self.finding.state == IDLE and self._new_path is None)

    @property
    def _is_alive(self) -> bool:
        """False if no look has reached the executor for LONGEST_LOOK."""
        return time.monotonic() - self._looked <= LONGEST_LOOK

    def _send_stops(self) -> None:
        """Publish ~/stop each PERIOD and when it is new; a watch that hangs says nothing."""
        while self._life.stopped is None and self._node.context.ok():
            if self._is_alive:
                self._node.guard.call(lambda: self._stop.publish(Bool(data=self._stops)))
            self._stop_is_new.wait(PERIOD)
            self._stop_is_new.clear()

    def close(self) -> None:
        """End the threads."""
        with self._changed:
            self._life.stop(STOPPING, "the server is shutting down")
            self._changed.notify_all()
        self._stop_is_new.set()
        self._heartbeat.join(END_TIME)
        self._thread.join(END_TIME)

    def _set_path(self, path: WatchedPath | None) -> None:
        with self._changed:
            self._new_path = path
            self._sight = None  # it knows the map and the pose of before the path was accepted

    def _switch(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        """Set the parameter `monitor`, so that there is one place that has its value."""
        result = self._node.set_parameters([Parameter("monitor", value=bool(request.data))])[0]
        response.success = bool(result.successful)
        state = "accepted paths are watched" if self.enabled else "no path is watched"
        response.message = result.reason or state
        return response

    def _offer_sight(self) -> None:
        """Hand what is known now to the thread; a look that still waits is replaced."""
        now = self._node.get_clock().now().nanoseconds
        snapshot, pose = self._service.snapshot(now), self._find_pose()
        self._map_age = snapshot.map_age
        with self._changed:
            self._sight = Sight(snapshot, pose, time.monotonic())
            self._changed.notify_all()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._sight or self._life.stopped)
                if self._life.stopped is not None:
                    return
                sight, path = self._sight, self._new_path
                self._sight = self._new_path = None
            assert sight is not None
            try:
                with interruptible(self._life.check):
                    finding = self._look(sight, path)
            except QuestionStoppedError:
                return
            except Exception as error:
                if self._life.stopped is not None or not self._node.context.ok():
                    return  # what the thread calls may have ended before it
                text = self._node.guard.report("monitor", error)
                finding = self._monitor.stop(refuse_for(text))
            self._hand_over(finding, sight)

    def _look(self, sight: Sight, path: WatchedPath | None) -> Finding:
        if path is not None and not len(path.poses):
            self._monitor.forget()
        elif path is not None and not self._monitor.take_path(path, sight):
            logger = self._node.get_logger()
            logger.warning("monitor: the rover does not stand on the accepted path; not watched")
        return self._monitor.look(sight)

    def _hand_over(self, finding: Finding, sight: Sight) -> None:
        """Publish a finding at once; classes of a stop's waypoints take longer and follow."""
        self._node.handover.call(lambda: self._take(finding))
        judgement = finding.judgement
        if finding.state != STOPPED or judgement is None or judgement is self._reported:
            return
        self._reported = judgement
        with interruptible(self._life.check):
            complete = judgement.complete()
        self._node.handover.call(
            lambda: self._report_stop(complete, finding.path_hash, sight.snapshot)
        )

    def _take(self, finding: Finding) -> None:
        """Have ~/stop published at once where it has changed; called in the executor's thread."""
        stopped, before = self._stops, self.finding
        self.finding, self._looked = finding, time.monotonic()
        if not self.enabled or finding.state == before.state:
            return
        if self._stops != stopped:
            self._stop_is_new.set()
        logger = self._node.get_logger()
        if finding.state == STOPPED:
            assert finding.judgement is not None
            logger.error(f"monitor: stop: {finding.judgement.reason}")
        else:
            logger.info(f"monitor: {finding.state}")
