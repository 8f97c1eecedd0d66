"""The results of a traverse server on their topics: one judged path, one stamp for all of it."""

from functools import partial

import numpy as np
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Path
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from msg_adapters.markers import cleared_markers, path_markers
from msg_adapters.paths import decimate, empty_path, settled_path
from msg_adapters.predictions import (
    MEASURES,
    empty_trajectory,
    joint_trajectory,
    tip_over_array,
    waypoint_array,
)
from msg_adapters.verdicts import verdict_to_diagnostics
from rover_physics.names import WHEELS
from rover_physics.rover import Rover
from rover_planner.afterwards import Afterwards
from rover_planner.judgement import Judgement
from rover_planner.path_query import Candidate
from rover_planner.qos import result_qos

WHEEL_TOPICS = {
    "wheel_loads": "wheel_loads",
    "slip_ratios": "slip_ratio",
    "friction_utilisation": "friction_utilisation",
    "torque_saturation": "torque_saturation",
}
"""Topics of one value per waypoint and wheel, and the field of the prediction each carries."""


class ResultTopics:
    """Publishes judgements; the plan is made at once, the rest when the answer has been sent."""

    def __init__(self, node: Node, afterwards: Afterwards, map_frame: str):
        self._node, self._afterwards, self._frame = node, afterwards, map_frame
        qos = result_qos()
        self._plan = node.create_publisher(Path, "~/plan", qos)
        self._joints = node.create_publisher(JointTrajectory, "~/predicted_joints", qos)
        self._wheels = {
            topic: node.create_publisher(Float64MultiArray, f"~/{topic}", qos)
            for topic in WHEEL_TOPICS
        }
        self._tip_over = node.create_publisher(Float64MultiArray, "~/tip_over_margin", qos)
        self._verdict = node.create_publisher(DiagnosticArray, "~/verdict", qos)
        self._markers = node.create_publisher(MarkerArray, "~/markers", qos)

    def take(self, judgement: Judgement, rover: Rover, plan_spacing: float) -> Path:
        """Return the plan of a judgement, and publish all results once the answer is sent.

        Args:
            judgement: The answer.
            rover: The rover that was asked about.
            plan_spacing: Distance between poses of the plan [m]; 0 keeps all waypoints.
        """
        stamp = self._node.get_clock().now().to_msg()
        plan = empty_path(self._frame, stamp)
        if judgement.candidate is not None and judgement.traversable:
            rows = _rows_to_show(judgement, judgement.candidate, plan_spacing)
            plan = settled_path(judgement.candidate.prediction, rows, self._frame, stamp)
        self._afterwards.do(
            partial(self._publish, judgement, rover, plan_spacing, plan, plan.header.stamp)
        )
        return plan

    def _publish(
        self, judgement: Judgement, rover: Rover, plan_spacing: float, plan: Path, stamp: Time
    ) -> None:
        self._plan.publish(plan)
        if judgement.candidate is None:
            self._publish_nothing(stamp)
        else:
            self._publish_path(judgement, judgement.candidate, rover, plan_spacing, stamp)
        warn = not judgement.verdict.get("suspension_agrees", True)
        self._verdict.publish(
            verdict_to_diagnostics(judgement.verdict, rover.name, self._frame, stamp, warn=warn)
        )

    def _publish_nothing(self, stamp: Time) -> None:
        """Publish empty messages where no path was judged."""
        self._joints.publish(empty_trajectory(self._frame, stamp))
        for publisher in self._wheels.values():
            publisher.publish(waypoint_array(np.empty((0, len(WHEELS)))))
        self._tip_over.publish(waypoint_array(np.empty((0, len(MEASURES))), "measure"))
        self._markers.publish(cleared_markers(self._frame, stamp))

    def _publish_path(
        self,
        judgement: Judgement,
        candidate: Candidate,
        rover: Rover,
        plan_spacing: float,
        stamp: Time,
    ) -> None:
        """Publish what is predicted along a judged path."""
        prediction = candidate.prediction
        self._joints.publish(joint_trajectory(prediction, rover.wheel.radius, self._frame, stamp))
        for topic, field in WHEEL_TOPICS.items():
            self._wheels[topic].publish(waypoint_array(getattr(prediction, field)))
        self._tip_over.publish(tip_over_array(prediction))
        rows = _rows_to_show(judgement, candidate, plan_spacing)
        grades = [grade.grade for grade in judgement.grades]
        self._markers.publish(
            path_markers(prediction, candidate.verdict.reasons, rows, self._frame, stamp, grades)
        )


def _rows_to_show(judgement: Judgement, candidate: Candidate, spacing: float) -> NDArray[np.intp]:
    """Return waypoints about `spacing` [m] apart, and those where the grade changes."""
    return decimate(candidate.poses, spacing, judgement.changes())
