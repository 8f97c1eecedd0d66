"""What is put off runs after the callback, requests first, and a fault in it is not the end."""

import threading
import time
from functools import partial

import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import Trigger

import rover_planner.ros.deferred_work
from rover_planner.ros.deferred_work import MAX_WAITING, DeferredWork
from support.ros_fixtures import call
from support.waiting import TIMEOUT, wait_until


@pytest.fixture
def busy(ros):
    """Return a node that is not spun yet."""
    return Node("busy", context=ros.context)


def test_what_is_put_off_runs_answer_by_answer_and_only_when_the_node_spins(ros, busy):
    executor = SingleThreadedExecutor(context=ros.context)
    executor.add_node(busy)
    deferred_work, done = DeferredWork(busy), []
    for answer in "abc":
        deferred_work.do(*(partial(done.append, f"{answer}{k}") for k in range(3)))
    assert done == []
    end = time.monotonic() + TIMEOUT
    while len(done) < 9 and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    assert done == ["a0", "a1", "a2", "b0", "b1", "b2", "c0", "c1", "c2"]
    executor.shutdown()
    busy.destroy_node()


def test_the_answer_does_not_wait_for_the_work(ros, client, busy):
    deferred_work, answered, waited = DeferredWork(busy), threading.Event(), []

    def answer(_request, response):
        deferred_work.do(lambda: waited.append(answered.wait(TIMEOUT)))
        return response

    busy.create_service(Trigger, "ask", answer)
    ros.spin(busy)
    call(client.create_client(Trigger, "ask"), Trigger.Request())
    answered.set()
    wait_until(lambda: waited == [True], "the work")


def test_a_request_goes_before_what_is_left_of_the_work(ros, client, busy):
    deferred_work, told, pieces = DeferredWork(busy), [], 2000

    def work(k):
        if "second" not in told:  # so that work is left however late the request comes
            time.sleep(0.01)
        told.append(k)

    def answer(_request, response):
        if "first" in told:
            told.append("second")
        else:
            told.append("first")
            deferred_work.do(*(partial(work, k) for k in range(pieces)))
        return response

    busy.create_service(Trigger, "ask", answer)
    ros.spin(busy)
    ask = client.create_client(Trigger, "ask")
    call(ask, Trigger.Request())
    wait_until(lambda: 0 in told, "the first of the work")
    call(ask, Trigger.Request())
    wait_until(lambda: len(told) == pieces + 2, "the work")
    assert told.index("second") < told.index(pieces - 1)
    assert [one for one in told if isinstance(one, int)] == list(range(pieces))


def test_requests_without_a_pause_leave_no_more_than_so_many_waiting(
    ros, client, busy, monkeypatch
):
    monkeypatch.setattr(rover_planner.ros.deferred_work, "QUIET", 1e3)  # no pause is long enough
    deferred_work, done, asked = DeferredWork(busy), [], 3 * MAX_WAITING

    def answer(_request, response):
        response.message = str(len(done))
        number = next(numbers)
        deferred_work.do(partial(done.append, (number, 0)), partial(done.append, (number, 1)))
        return response

    numbers = iter(range(asked))
    busy.create_service(Trigger, "ask", answer)
    ros.spin(busy)
    ask = client.create_client(Trigger, "ask")
    for k in range(asked):
        finished = int(call(ask, Trigger.Request()).message) // 2
        assert finished == max(0, k - MAX_WAITING)
    expected = [(k, piece) for k in range(asked - MAX_WAITING) for piece in (0, 1)]
    wait_until(lambda: done == expected, "the work of all but the last")


def test_a_fault_leaves_the_rest_and_the_node(ros, client, busy):
    deferred_work, done = DeferredWork(busy), []
    deferred_work.do(lambda: 1 / 0, lambda: done.append("the rest"))
    deferred_work.do(lambda: 1 / 0)
    deferred_work.do(lambda: done.append("the next"))
    ros.spin(busy)
    wait_until(lambda: done == ["the rest", "the next"], "the rest")
    assert ros.is_alive(busy)
    client.wait_for_log("ZeroDivisionError")
