"""What is put off runs after the callback, in order, and a fault in it is not the end."""

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from ros_fixtures import call, wait_until
from std_srvs.srv import Trigger

from rover_planner.afterwards import Afterwards


def test_what_is_put_off_runs_in_order_and_only_when_the_node_spins(ros):
    node = Node("busy", context=ros.context)
    executor = SingleThreadedExecutor(context=ros.context)
    executor.add_node(node)
    afterwards, done = Afterwards(node), []
    for k in range(3):
        afterwards.do(lambda k=k: done.append(k))
    assert done == []
    executor.spin_once(timeout_sec=5.0)
    assert done == [0, 1, 2]
    executor.shutdown()
    node.destroy_node()


def test_the_answer_does_not_wait_and_the_next_request_does(ros, client):
    node = Node("busy", context=ros.context)
    afterwards, told = Afterwards(node), []

    def answer(_request, response):
        told.append("asked")
        afterwards.do(lambda: told.append("done"))
        assert told[-1] == "asked"
        return response

    node.create_service(Trigger, "ask", answer)
    ros.spin(node)
    ask = client.create_client(Trigger, "ask")
    for _ in range(5):
        call(ask, Trigger.Request())
    wait_until(lambda: told == ["asked", "done"] * 5, "the work")


def test_a_fault_leaves_the_rest_and_the_node(ros, client):
    node = Node("busy", context=ros.context)
    afterwards, done = Afterwards(node), []
    afterwards.do(lambda: 1 / 0)
    afterwards.do(lambda: done.append("the rest"))
    ros.spin(node)
    wait_until(lambda: done, "the rest")
    assert ros.is_alive(node)
    client.wait_for_log("ZeroDivisionError")
