# SPDX-License-Identifier: Apache-2.0
"""The node /traction_controller: commands wheel torques by a QP at a fixed rate."""

import sys
import time
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from std_msgs.msg import Bool, Header
from std_srvs.srv import SetBool

from msg_adapters.results.diagnostics import TORQUES, make_status
from rover_physics.names import WHEEL_COUNT
from rover_planner.nodes.running import run_node
from rover_planner.nodes.traction_topics import TractionInputs, TractionMaps, TractionTopics
from rover_planner.nodes.warm_up import TRACTION, load_kernels, update_traction
from rover_planner.parameters.traction_controller import TractionControllerParameters
from rover_planner.ros.frames import NodeFrames
from rover_planner.ros.logs import TransitionLog
from rover_planner.ros.node import RoverNode, create_steady_timer
from rover_planner.ros.qos import LATCHED_QOS, SENSOR_QOS, TOPIC_QOS
from rover_planner.traction.input_monitor import ClockWatch
from rover_planner.traction.settings import TractionSettings, load_traction_settings
from rover_planner.traction.statistics import TractionStatistics, judge_update
from rover_planner.traction.supervisor import TractionSupervisor
from rover_planner.traction.traction_service import (
    DISABLED,
    DRIVING,
    FAULT,
    STALLED,
    TractionCommand,
    TractionService,
)
from rover_planner.traction.watchdog import Watchdog

NODE_NAME = "traction_controller"
DIAGNOSTICS_PERIOD = 1.0
"""Time between two diagnostic messages [s]."""
STANDING_RATE = 0.01
"""Wheel rate below which a wheel stands [rad/s]."""
MOST_REPEATS = 2
"""Number of updates in a row that send the last command of a rover at rest again."""
MIN_WATCHDOG_PERIODS = 2.0
"""Shortest time without an update after which the watchdog acts, in periods."""
STALE_PERIODS = 1.5
"""Time after an input became stale at which the watchdog acts, in periods; updates act first."""
SWITCH_INTERVAL = 2e-4
"""Longest time for which the thread that prepares maps may delay an update [s]; Python's
thread switch interval."""
ARRIVAL_TIME = Duration(seconds=0.2)
"""Longest wait for the final zero torques to reach their subscribers."""
LOOP_FAULT = "updates came too late; the watchdog sent zero torques"


class TractionController(RoverNode[TractionControllerParameters]):
    """Connects a TractionSupervisor to ROS; any fault takes the driving torques away in time."""

    def __init__(self, **node_arguments: Any):
        super().__init__(NODE_NAME, TractionControllerParameters, **node_arguments)
        values, settings = self.values, load_traction_settings(self.values)
        load_kernels(TRACTION, (), self.get_logger().info)
        update_traction(settings)  # so that the first update is as fast as others
        self._supervisor = TractionSupervisor(settings, values.enabled_at_start)
        self.statistics = TractionStatistics(1.0 / values.rate)
        """Update times, counts and the last update."""
        self._command: TractionCommand | None = None
        self._repeats = 0
        self._log = TransitionLog(self.get_logger())
        self._warning = ""
        self._trips = 0
        self._clock_watch = ClockWatch(values.clock_timeout)
        self.frames = NodeFrames(self, values)
        """Knows where the frames of messages are on the map."""
        self._maps = TractionMaps(self, self.service, self.frames)
        self._inputs = TractionInputs(self, self.service, self._maps, self.frames)
        self._topics = TractionTopics(self, self.service, self._inputs.joint_names)
        self._create_switches()
        self._watchdog = Watchdog(lambda: self._topics.write(np.zeros(WHEEL_COUNT), True, FAULT))
        self.follow_changes(
            lambda changed: load_traction_settings(changed, self.service.settings),
            self._apply_settings,
        )
        self._timer = self.loop = create_steady_timer(self, 1.0 / values.rate, self.update)
        create_steady_timer(self, DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        self.get_logger().info(
            f"ready for rover {self.service.settings.rover.name}, "
            f"{'enabled' if values.enabled_at_start else 'disabled: call ~/enable to drive'}"
        )

    @property
    def service(self) -> TractionService:
        """The service that takes measurements and returns torques."""
        return self._supervisor.service

    @property
    def state(self) -> str:
        """The state as on ~/state, such as driving; empty before the first update."""
        return "" if self._command is None else self._command.state

    def stop(self) -> None:
        """Send zero torques and the brake, wait until they have arrived, and stop updating."""
        self._timer.cancel()
        self._watchdog.close()
        self._topics.write(np.zeros(WHEEL_COUNT), True, DISABLED)
        self._topics.commands.wait_for_all_acked(ARRIVAL_TIME)

    def destroy_node(self) -> None:
        """Send zero torques and destroy the node."""
        if self.context.ok():
            self.stop()
        self._watchdog.close()
        self._maps.close()
        super().destroy_node()

    def _create_switches(self) -> None:
        """Create the service that enables and the subscriptions to the emergency stop.

        No single profile hears every publisher and also gets a stop that was sent before the node
        started, so there are three subscriptions; a stop may arrive three times.
        """
        self.create_service(SetBool, "~/enable", self._enable)
        for qos in (TOPIC_QOS, LATCHED_QOS, SENSOR_QOS):
            self.heard.subscribe(Bool, "~/emergency_stop", self._take_emergency_stop, qos)

    def _apply_settings(self, settings: TractionSettings) -> None:
        before, values = self.service.settings, self.values
        self._supervisor.configure(settings)
        self._clock_watch.timeout = values.clock_timeout
        self.frames.apply_timeout(values.transform_timeout)
        self._maps.apply(before.parameters)

    def _enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        before = self._supervisor.enabled
        done, message = self._supervisor.set_enabled(request.data)
        response.success, response.message = done, message
        if self._supervisor.enabled != before or not done:
            self.get_logger().info(message)
            self._repeats = MOST_REPEATS  # the next update is a whole one
            self.update()
        return response

    def _take_emergency_stop(self, message: Bool, _arrival: float) -> None:
        if message.data == self._supervisor.emergency_stop:
            return
        self._supervisor.take_emergency_stop(message.data)
        self.get_logger().warning(
            "emergency stop" if message.data else "emergency stop released; ~/enable drives again"
        )

    def update(self) -> None:
        """Estimate, build, solve and publish; called by the timer.

        While the rover stands, two updates of three send the last command again: to read and to
        judge the inputs takes most of the time.
        """
        start, now = time.perf_counter(), time.monotonic()
        repeated = self._find_repeated(now)
        if repeated is None:
            self.heard.poll()
            now = time.monotonic()
        command = repeated or self._find_command(now)
        sent = self._watchdog.send(
            lambda: self._topics.send(command), now, self._find_deadline(now, command)
        )
        if not sent:
            command = self._supervisor.fail(LOOP_FAULT)
            self._topics.send(command)  # torques of a sending that hung are not the last ones
        self._topics.publish_forces(command)
        self.statistics.take(command, start, time.perf_counter())
        self._log_changes(command, now)

    def _find_repeated(self, now: float) -> TractionCommand | None:
        """Return the last command if this update is to send it again, else None."""
        last, rates = self._command, self.service.joints.wheel_rates
        repeats = (
            last is not None
            and last.state != DRIVING
            and max(abs(rates)) < STANDING_RATE
            and self._watchdog.trips == self._trips
            and self._repeats < MOST_REPEATS
            and now + 1.0 / self.values.rate < last.expiry
        )
        self._repeats = self._repeats + 1 if repeats else 0
        return last if repeats else None

    def _find_command(self, now: float) -> TractionCommand:
        """Return the command of the supervisor, or that of an internal error.

        After one the wheels must not keep their last torque.
        """
        try:
            return self._supervise(now)
        except Exception as error:
            reported = self.guard.report("update", error)
            return self._supervisor.fail(f"internal error: {reported}")

    def _supervise(self, now: float) -> TractionCommand:
        prepared = self._maps.take()
        if prepared is not None:
            self.service.take_map(prepared)
        if self._watchdog.trips != self._trips:
            self._trips = self._watchdog.trips
            self._supervisor.trip(LOOP_FAULT)
        clock = self.get_clock()
        # Both clocks are read at once: what the update did before is no step of one of them.
        seen, stamp = time.monotonic(), clock.now().nanoseconds
        fault = self._clock_watch.check(seen, stamp, clock.ros_time_is_active)
        if self._clock_watch.stepped:
            self.service.forget_times()
        return self._supervisor.update(now, fault)

    def _find_deadline(self, now: float, command: TractionCommand) -> float:
        """Return the time at which the watchdog acts unless another command comes [s]."""
        period = 1.0 / self.values.rate
        next_update = now + max(self.values.watchdog_timeout, MIN_WATCHDOG_PERIODS * period)
        return min(next_update, max(command.expiry, now) + STALE_PERIODS * period)

    def _log_changes(self, command: TractionCommand, now: float) -> None:
        """Log the begin and the end of faults and stalls; show a new state in the diagnostics."""
        last, self._command = self._command, command
        policy = self.values.rest_policy
        fault = f"fault, rest by {policy}: {command.fault}" if command.fault else ""
        self._log.update(FAULT, fault, "all inputs are right", now)
        stalled = "stalled: no progress, stopped pushing" if command.state == STALLED else ""
        self._log.update(STALLED, stalled, "no longer stalled", now)
        if last is None or (last.state, last.fault) != (command.state, command.fault):
            self._publish_diagnostics()
        if command.warning and command.warning != self._warning:
            self.get_logger().warning(command.warning)
            self._warning = command.warning

    def _publish_diagnostics(self) -> None:
        self._maps.retry()
        command = self._command
        if command is None:
            return
        problems = [*self._inputs.publishers.problems, *filter(None, [command.warning])]
        values = {
            "state": command.state,
            **self.statistics.describe(),
            "watchdog_trips": self._watchdog.trips,
            "internal_errors": self.guard.total,
            "brake": command.brake,
            "warning": "; ".join(problems),
        }
        level, text = judge_update(command, problems)
        status = make_status(TORQUES, level, text, values, self.service.settings.rover.name)
        header = Header(stamp=self.get_clock().now().to_msg())
        self._topics.diagnostics.publish(DiagnosticArray(header=header, status=[status]))


main = partial(run_node, NODE_NAME, TractionController, SWITCH_INTERVAL)
"""Runs the node until it is stopped; returns 2 for a wrong argument or parameter, else 0."""


if __name__ == "__main__":
    sys.exit(main())
