# SPDX-License-Identifier: Apache-2.0
"""Ask the running service over ROS 2, as a mission planner does, with standard messages only.

Starts `traverse_server` on the map of Spirit's surroundings and asks GetPlan for four goals: is
there a path that the rover can traverse? An empty plan is a no. The verdict that is published
with each answer has the reason and the numbers; the stamp of the plan tells which one it is.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from matplotlib import pyplot
from nav_msgs.srv import GetPlan
from rclpy.qos import DurabilityPolicy, QoSProfile

from rover_physics import load_terrain

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
os.environ.setdefault("ROS_DOMAIN_ID", "83")  # away from other robots
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
command = [sys.executable, "-m", "rover_planner.nodes.traverse_server", "--ros-args"]
for setting in ("rover:=lsr1", "terrain_file:=spirit", "unknown_cells:=interpolate"):
    command += ["-p", setting]
server = subprocess.Popen(command)
try:
    rclpy.init()
    node = rclpy.create_node("asking")
    verdicts = {}
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)

    def keep(message: DiagnosticArray) -> None:
        """Keep the keys of a verdict by the stamp of its plan."""
        stamp = message.header.stamp.sec, message.header.stamp.nanosec
        verdicts[stamp] = {entry.key: entry.value for entry in message.status[0].values}

    node.create_subscription(DiagnosticArray, "traverse_server/verdict", keep, latched)
    client = node.create_client(GetPlan, "traverse_server/can_traverse")
    if not client.wait_for_service(120.0):
        raise SystemExit("traverse_server does not answer")

    mars = load_terrain("spirit")
    figure, axis = pyplot.subplots(figsize=(7, 6), layout="constrained")
    x0, x1, y0, y1 = mars.bounds
    axis.imshow(mars.elevation, cmap="gray", origin="lower", extent=(x0, x1, y0, y1))
    axis.plot(-44.4, -19.4, "k*", markersize=12)
    for x, y in ((-46.0, -19.0), (-47.5, -21.0), (-45.5, -20.5), (-44.0, -25.0)):
        request = GetPlan.Request()
        for place, (px, py) in ((request.start, (-44.4, -19.4)), (request.goal, (x, y))):
            place.header.frame_id = "map"
            place.pose.position.x, place.pose.position.y = px, py
            place.pose.orientation.z = 1.0  # heading along -x
            place.pose.orientation.w = 0.0
        answer = client.call_async(request)
        rclpy.spin_until_future_complete(node, answer)
        plan = answer.result().plan
        stamp = plan.header.stamp.sec, plan.header.stamp.nanosec
        while stamp not in verdicts:
            rclpy.spin_once(node)
        verdict = verdicts[stamp]
        words = f"{float(verdict['length']):.1f} m" if plan.poses else f"no: {verdict['reason']}"
        print(f"to {x}, {y}: {words}")
        axis.plot(x, y, "go" if plan.poses else "rx", markersize=9)
        axis.plot(*np.array([[p.pose.position.x, p.pose.position.y] for p in plan.poses]).T)
    axis.set(title="plans of traverse_server, and goals that it refuses [m]")
    figure.savefig(folder / "06_plans.png")
finally:
    server.send_signal(signal.SIGINT)
    server.wait(20.0)
    rclpy.try_shutdown()
