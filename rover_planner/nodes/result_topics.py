"""Publishes the results of a traverse server: all results of a judged path have one stamp."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import MarkerArray

from msg_adapters.markers import cleared_markers, path_markers
from msg_adapters.paths import PoseStock, decimate, empty_path, settled_path
from msg_adapters.predictions import (
    MEASURES,
    empty_trajectory,
    joint_trajectory,
    tip_over_array,
    waypoint_array,
)
from msg_adapters.verdicts import verdict_to_diagnostics
from rover_physics.names import WHEELS
from rover_physics.rover.model import Rover
from rover_planner.planning.judgement import Judgement
from rover_planner.ros.deferred_work import DeferredWork
from rover_planner.ros.lazy_publisher import LazyPublisher

WHEEL_TOPICS = {
    "wheel_loads": "wheel_loads",
    "slip_ratios": "slip_ratio",
    "friction_utilisation": "friction_utilisation",
    "torque_saturation": "torque_saturation",
}
"""Topics with one value per waypoint and wheel, and the field of the prediction on each."""
LOOK_OUT = 0.2
"""Period of the check for new subscribers [s]."""

_KINDS = {
    "plan": Path,
    **dict.fromkeys([*WHEEL_TOPICS, "tip_over_margin"], Float64MultiArray),
    "predicted_joints": JointTrajectory,
    "verdict": DiagnosticArray,
    "markers": MarkerArray,
}
"""Topics in the order of publication, and their message types."""


class ResultTopics:
    """Makes the plan of a judgement at once and publishes all results after the answer is sent."""

    def __init__(self, node: Node, deferred_work: DeferredWork, map_frame: str):
        self._node, self._deferred_work, self._frame = node, deferred_work, map_frame
        self._poses = PoseStock()
        self._points: list[JointTrajectoryPoint] = []
        self._topics = {
            name: LazyPublisher(node, kind, f"~/{name}") for name, kind in _KINDS.items()
        }
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(LOOK_OUT, self._serve_late_comers, clock=steady)

    def take(
        self,
        judgement: Judgement,
        rover: Rover,
        plan_spacing: float,
        log: Callable[[], None],
    ) -> Path:
        """Return the plan of a judgement; publish all results after the answer is sent.

        Args:
            judgement: The answer.
            rover: The rover of the query.
            plan_spacing: Distance between poses of the plan [m]; 0 keeps all waypoints.
            log: Called after the answer is sent, before the results are published.

        Returns:
            The plan; its poses are valid until the next plan is made.
        """
        stamp = self._node.get_clock().now().to_msg()
        results = _Results(
            judgement, rover, plan_spacing, self._frame, stamp, self._poses, self._points
        )
        publications = [
            partial(topic.publish, partial(results.message, name))
            for name, topic in self._topics.items()
        ]
        self._deferred_work.do(log, *publications)
        return results.plan()

    def _serve_late_comers(self) -> None:
        awaited = [topic for topic in self._topics.values() if topic.is_awaited]
        if awaited:
            self._deferred_work.do(*(topic.catch_up for topic in awaited))


@dataclass(frozen=True)
class _Results:
    """The messages of one judgement; each is made on demand."""

    judgement: Judgement
    rover: Rover
    plan_spacing: float
    frame: str
    stamp: Time
    poses: PoseStock
    points: list[JointTrajectoryPoint]

    def message(self, topic: str) -> object:
        """Return the message for a topic."""
        if topic == "plan":
            return self.plan()
        if topic == "verdict":
            return self._verdict()
        if self.judgement.candidate is None:
            return self._nothing(topic)
        return self._prediction(topic)

    def plan(self) -> Path:
        """Return the path to drive, without poses if none is traversable."""
        candidate = self.judgement.candidate
        if candidate is None or not self.judgement.traversable:
            return empty_path(self.frame, self.stamp)
        return settled_path(
            candidate.prediction, self._rows_to_show(), self.frame, self.stamp, self.poses
        )

    def _verdict(self) -> DiagnosticArray:
        report = self.judgement.report
        return verdict_to_diagnostics(report, self.rover.name, self.frame, self.stamp)

    def _nothing(self, topic: str) -> object:
        """Return the empty message that is published if no path was judged."""
        if topic == "predicted_joints":
            return empty_trajectory(self.frame, self.stamp)
        if topic == "markers":
            return cleared_markers(self.frame, self.stamp)
        if topic == "tip_over_margin":
            return waypoint_array(np.empty((0, len(MEASURES))), "measure")
        return waypoint_array(np.empty((0, len(WHEELS))))

    def _prediction(self, topic: str) -> object:
        """Return the predicted values along a judged path."""
        candidate = self.judgement.candidate
        assert candidate is not None
        prediction = candidate.prediction
        if topic == "predicted_joints":
            radius = self.rover.wheel.radius
            return joint_trajectory(prediction, radius, self.frame, self.stamp, self.points)
        if topic == "markers":
            classes = [waypoint.traversability_class for waypoint in self.judgement.classes]
            reasons, rows = candidate.verdict.reasons, self._rows_to_show()
            return path_markers(prediction, reasons, rows, self.frame, self.stamp, classes)
        if topic == "tip_over_margin":
            return tip_over_array(prediction)
        return waypoint_array(getattr(prediction, WHEEL_TOPICS[topic]))

    def _rows_to_show(self) -> NDArray[np.intp]:
        """Return indices of waypoints about `plan_spacing` apart and where the class changes."""
        candidate = self.judgement.candidate
        assert candidate is not None
        return decimate(candidate.poses, self.plan_spacing, self.judgement.changes())
