# SPDX-License-Identifier: Apache-2.0
"""A service whose responses are sent later, while the node goes on with other work."""

from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from rover_planner.ros.qos import service_qos

Reply = Callable[[Any], None]
"""Function that sends a response; called once per request, in the executor's thread."""


def serve_later(
    node: Node, kind: type, name: str, take: Callable[[Any, Any, Reply], None]
) -> None:
    """Create a service that takes requests without a response.

    Args:
        node: The node.
        kind: Type of the service.
        name: Name of the service.
        take: Called with the request, an empty response, and the function that sends it when it
            is filled.
    """

    def hand_on(request: Any, response: Any) -> tuple[Any, Any]:
        return request, response

    service = node.create_service(kind, name, hand_on, qos_profile=service_qos())
    send_response = service.send_response

    def receive(exchange: tuple[Any, Any], header: Any) -> None:
        take(*exchange, lambda response: send_response(response, header))

    # rclpy sends what a callback returns, together with the header of the request; coroutines
    # would keep its executor busy while they wait.
    setattr(service, "send_response", receive)  # noqa: B010, a method that is replaced
