# SPDX-License-Identifier: Apache-2.0
"""Publishes the results of a traverse server: all results of a judged path have one stamp."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import OccupancyGrid, Path
from numpy.typing import NDArray
from std_msgs.msg import Float64MultiArray, Header
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from msg_adapters.paths import decimate, settled_path
from msg_adapters.results.diagnostics import VERDICT, make_status, texts_of
from msg_adapters.results.grids import NOT_REACHED, REACHED, occupancy_grid
from msg_adapters.results.markers import cleared_markers, path_markers
from msg_adapters.results.predictions import joint_trajectory, tip_over_array, wheel_array
from msg_adapters.stamps import ns_to_stamp
from rover_physics.numerics.plain_values import to_plain
from rover_physics.results.path_prediction import PathPrediction
from rover_physics.rover.model import Rover
from rover_planner.parameters.traverse_server import TraverseServerParameters
from rover_planner.planning.answering.judgement import PER_WAYPOINT, IdentityReport, PathJudgement
from rover_planner.ros.lazy_publisher import LazyPublisher
from rover_planner.ros.node import RoverNode
from rover_planner.ros.server_inputs import ServerInputs, describe_path

WHEEL_TOPICS = {
    "wheel_loads": "wheel_loads",
    "slip_ratios": "slip_ratio",
    "friction_utilisation": "friction_utilisation",
    "torque_saturation": "torque_saturation",
}
"""Topics with one value per waypoint and wheel, and the field of the prediction on each."""
SET_BACK = 1_000_000_000
"""Time [ns] up to which a clock that was set back counts as standing still."""


class ResultTopics:
    """Makes the plan of a judgement at once and publishes all results after the answer is sent."""

    def __init__(self, node: RoverNode[TraverseServerParameters], inputs: ServerInputs):
        """Create the topics; `inputs` know the rover, and joints and frame of messages."""
        self._node, self._inputs = node, inputs
        self._stamp = 0
        self._topics = {
            name: LazyPublisher(node, kind, f"~/{name}") for name, (kind, _) in RESULTS.items()
        }

    def take(self, judgement: PathJudgement, identity: IdentityReport) -> "ResultMessages":
        """Return the messages of a judgement; publish them after the answer is sent.

        Args:
            judgement: The answer.
            identity: What it is about; without a path, that of the plan is added.
        """
        results = ResultMessages(judgement, identity, self._next_stamp(), self._inputs)
        if judgement.traversable and not identity.path_hash:
            path_hash, path_stamp = describe_path(results.plan)
            results.identity = replace(identity, path_hash=path_hash, path_stamp=path_stamp)
        self._node.handover.call(partial(self._log, results))
        for name, (_, make) in RESULTS.items():
            publish = partial(self._topics[name].publish, partial(make, results))
            self._node.handover.call(publish)
        return results

    def _next_stamp(self) -> int:
        """Return the ROS time [ns], or just after the last stamp if the clock stands still.

        A clock that was set back by more than SET_BACK is followed.
        """
        now = self._node.get_clock().now().nanoseconds
        stands = self._stamp - SET_BACK < now <= self._stamp
        self._stamp = self._stamp + 1 if stands else now
        return self._stamp

    def _log(self, results: "ResultMessages") -> None:
        judgement, about = results.judgement, results.identity
        text = f"question {about.request}, {about.service}: {judgement.summary()}"
        if judgement.traversable:
            self._node.get_logger().info(text)
        else:
            self._node.get_logger().warning(text)

    def serve_late_comers(self) -> None:
        """Publish the last results to new subscribers."""
        for topic in self._topics.values():
            topic.catch_up()


@dataclass(eq=False)
class ResultMessages:
    """The messages of one judgement; each is made on demand."""

    judgement: PathJudgement
    """The judgement."""
    identity: IdentityReport
    """Question, map and path that it is about."""
    stamp: int
    """Time of all messages [ns]."""
    inputs: ServerInputs
    """Know the rover, and joints and frames of messages."""

    @cached_property
    def header(self) -> Header:
        """Frame of the map, and stamp, of all messages."""
        frame = self.inputs.service.settings.parameters.map_frame
        return Header(frame_id=frame, stamp=ns_to_stamp(self.stamp))

    @property
    def rover(self) -> Rover:
        """The rover of the question."""
        site = self.judgement.site
        return self.inputs.service.settings.rover if site is None else site.rover

    @property
    def prediction(self) -> PathPrediction | None:
        """The prediction of the chosen candidate; None if no path was judged."""
        candidate = self.judgement.candidate
        return None if candidate is None else candidate.prediction

    @cached_property
    def report(self) -> dict[str, Any]:
        """The report, with what it is about."""
        return self.judgement.report | asdict(self.identity)

    @cached_property
    def plan(self) -> Path:
        """The path to drive, without poses if none is traversable."""
        candidate = self.judgement.candidate
        if candidate is None or not self.judgement.traversable:
            return Path(header=self.header)
        return self.inputs.frames.to_base(
            settled_path(candidate.prediction, self._rows_to_show(), self.header)
        )

    def verdict(self) -> DiagnosticArray:
        """Return the verdict and its summary."""
        judgement, report, level = self.judgement, self.report, "error"
        if judgement.traversable:
            level = "ok" if report.get("suspension_agrees", True) else "warning"
        summary = {key: report[key] for key in report if key not in PER_WAYPOINT}
        reason, entries = judgement.reason or "traversable", texts_of(to_plain(summary))
        status = make_status(VERDICT, level, reason, entries, self.rover.name)
        return DiagnosticArray(header=self.header, status=[status])

    def closed_area(self) -> OccupancyGrid:
        """Return the area that start or goal are closed in; without places if they are not."""
        around = self.judgement.around
        if around is None or around.closed is None:
            return OccupancyGrid(header=self.header)
        cell, (column, row) = around.nodes.cell, around.nodes.first
        first = cell * column, cell * row
        values = np.where(around.closed.places, REACHED, NOT_REACHED)
        return occupancy_grid(values, cell, first, self.header)

    def joints(self) -> JointTrajectory:
        """Return the predicted joints, without points if no path was judged."""
        names = self.inputs.joint_names
        return joint_trajectory(self.prediction, self.rover, self.header, names)

    def markers(self) -> MarkerArray:
        """Return markers of the path; if none was judged, the one that deletes all."""
        candidate = self.judgement.candidate
        if candidate is None:
            return cleared_markers(self.header)
        classes = [waypoint.traversability_class for waypoint in self.judgement.classes]
        reasons, rows = candidate.verdict.reasons, self._rows_to_show()
        return path_markers(candidate.prediction, reasons, rows, self.header, classes)

    def _rows_to_show(self) -> NDArray[np.intp]:
        """Return indices of waypoints about `plan_spacing` apart and where the class changes."""
        candidate = self.judgement.candidate
        assert candidate is not None
        spacing = self.inputs.service.settings.parameters.plan_spacing
        return decimate(candidate.prediction.poses, spacing, self.judgement.changes())


Maker = Callable[[ResultMessages], object]


def _of_wheels(field: str) -> tuple[type, Maker]:
    """Return type and maker of a message with values of wheels: a field of the prediction."""
    return Float64MultiArray, lambda one: wheel_array(one.prediction, field)


RESULTS: dict[str, tuple[type, Maker]] = {
    "plan": (Path, lambda one: one.plan),
    **{topic: _of_wheels(field) for topic, field in WHEEL_TOPICS.items()},
    "tip_over_margin": (Float64MultiArray, lambda one: tip_over_array(one.prediction)),
    "predicted_joints": (JointTrajectory, ResultMessages.joints),
    "verdict": (DiagnosticArray, ResultMessages.verdict),
    "closed_area": (OccupancyGrid, ResultMessages.closed_area),
    "markers": (MarkerArray, ResultMessages.markers),
}
"""Type and maker of the message of each topic, in the order of publication."""
