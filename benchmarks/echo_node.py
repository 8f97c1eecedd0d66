"""A node that answers GetPlan with a stored plan, to measure the cost of the service alone.

Run as python -m benchmarks.echo_node PLAN, where PLAN is a file with a serialised nav_msgs/Path.
"""

import sys
from pathlib import Path as FilePath

import rclpy
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.serialization import deserialize_message

SERVICE = "/echo/can_traverse"


def main() -> None:
    """Answer until interrupted."""
    plan = deserialize_message(FilePath(sys.argv[1]).read_bytes(), Path)
    rclpy.init()
    node = Node("echo")

    def answer(_request: GetPlan.Request, response: GetPlan.Response) -> GetPlan.Response:
        response.plan = plan
        return response

    node.create_service(GetPlan, SERVICE, answer)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
