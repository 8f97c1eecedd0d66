# SPDX-License-Identifier: Apache-2.0
"""Nothing that a callback raises ends a node, and what lasts or repeats is logged once."""

import threading
import time

import pytest
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.timer import Timer
from std_msgs.msg import String
from std_srvs.srv import Trigger

from rover_planner.ros.guard import Guard, GuardedExecutor, Handover
from rover_planner.ros.logs import REPEAT_PERIOD, RepeatLog, TransitionLog
from rover_planner.ros.polled_topics import PolledTopics
from rover_planner.ros.qos import TOPIC_QOS
from support.ros_fixtures import call
from support.waiting import wait_until


class Lines(list):
    """A logger that keeps its lines."""

    error = warning = info = list.append


class Fragile(Node):
    """A node whose callbacks raise."""

    def __init__(self, context):
        super().__init__("fragile", context=context)
        self.guard = Guard(Lines())
        self.heard: list[str] = []
        self.create_subscription(String, "words", self._take, 10)
        self.create_service(Trigger, "~/fail", lambda *_: 1 / 0)
        self.create_service(Trigger, "~/work", lambda _, response: response)
        self.timer = self.create_timer(0.05, self._tick)
        self.ticks = 0

    def _take(self, word):
        self.heard.append(word.data)
        if word.data == "bad":
            raise ValueError("a bad word")

    def _tick(self):
        self.ticks += 1
        raise RuntimeError("tick")


@pytest.mark.parametrize("has_loop", [False, True])
def test_a_node_outlives_errors_of_timers_subscriptions_and_services(ros, has_loop):
    node = Fragile(ros.context)
    node.loop = node.timer if has_loop else None
    ros.spin(node)
    other = ros.spin(Node("other", context=ros.context))
    words = other.create_publisher(String, "words", 10)
    wait_until(lambda: words.get_subscription_count() > 0, "the subscription")
    no_utf8 = serialize_message(String(data="x" * 40)).replace(b"xxxx", b"\xff\xfe\xfa\xf9")
    for bad in (String(data="bad"), no_utf8, no_utf8[:12]):
        words.publish(bad)
    wait_until(lambda: "bad" in node.heard, "the bad word")
    failing = other.create_client(Trigger, "fragile/fail")
    assert failing.wait_for_service(20.0)
    failing.call_async(Trigger.Request())
    wait_until(lambda: node.guard.counts["/fragile/fail: ZeroDivisionError"] == 1, "the failure")
    call(other.create_client(Trigger, "fragile/work"), Trigger.Request())
    words.publish(String(data="good"))
    wait_until(lambda: node.heard[-1] == "good", "the good word")
    ticks = node.ticks
    wait_until(lambda: node.ticks > ticks + 2, "the timer")


def test_an_entity_that_cannot_be_read_does_not_block_the_node(ros):
    node = Fragile(ros.context)
    executor = GuardedExecutor(context=ros.context)
    executor.add_node(node)

    def fail(_):
        raise MemoryError("no room for the message")

    executor._make_handler(next(iter(node.subscriptions)), node, fail)()
    assert node.default_callback_group.can_execute(node.timer)  # rclpy's own blocks it for ever
    executor.shutdown()
    node.destroy_node()


class CountingExecutor(GuardedExecutor):
    """Counts its wait sets: each asks once for the timer."""

    wait_sets = 0

    def can_execute(self, entity):
        self.wait_sets += isinstance(entity, Timer)
        return super().can_execute(entity)


def test_a_message_that_is_left_alone_ends_no_wait(ros):
    node = Fragile(ros.context)
    node.timer.cancel()
    heard = []
    PolledTopics(node, node.guard).subscribe(String, "news", heard.append, TOPIC_QOS)
    speaker = ros.spin(Node("speaker", context=ros.context))
    news = speaker.create_publisher(String, "news", TOPIC_QOS)
    wait_until(lambda: news.get_subscription_count() > 0, "the subscription")
    news.publish(String(data="later"))
    assert news.wait_for_all_acked(Duration(seconds=20.0))
    executor = CountingExecutor(context=ros.context)
    executor.add_node(node)
    end = time.monotonic() + 2.5
    while time.monotonic() < end:
        executor.spin_once(0.5)
    assert not heard and 5 <= executor.wait_sets <= 25
    executor.shutdown()
    node.destroy_node()


def test_a_wait_ends_while_the_simulated_clock_stands(ros):
    use_sim_time = Parameter("use_sim_time", value=True)
    node = Node("waiter", context=ros.context, parameter_overrides=[use_sim_time])
    executor = GuardedExecutor(context=ros.context)
    executor.add_node(node)
    waits = threading.Thread(
        target=lambda: [executor.spin_once(timeout_sec=0.01) for _ in range(5)], daemon=True
    )
    waits.start()
    wait_until(lambda: not waits.is_alive(), "the ends of waits", 5.0)
    executor.shutdown()
    node.destroy_node()


def test_an_error_is_logged_once_with_its_trace_and_counted():
    lines = Lines()
    guard = Guard(lines)
    for _ in range(5):
        guard.call(lambda: 1 / 0)
    assert guard.total == 5 and len(lines) == 1
    assert "Traceback" in lines[0] and "ZeroDivisionError" in lines[0]
    assert guard.recent(20.0) and not Guard(lines).recent(20.0)
    assert len(guard.report("x", ValueError("y" * 10_000))) <= 300


def test_functions_of_other_threads_run_in_order_and_an_error_ends_nothing(ros):
    node = Fragile(ros.context)
    node.timer.cancel()
    handover, told = Handover(node, node.guard), []
    for k in range(50):
        handover.call(lambda k=k: told.append(k))
        handover.call(lambda: 1 / 0)
    ros.spin(node)
    wait_until(lambda: len(told) == 50, "the calls")
    assert told == list(range(50))


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        # one that stays is told once, and its end once
        ([(0.01 * k, "nan" if k < 500 else "") for k in range(1000)], ["nan", "back"]),
        # one that began again within a second is told with its new reason
        ([(0.0, "waiting"), (0.3, ""), *((0.1 * k, "nan") for k in range(5, 15))],
         ["waiting", "nan"]),
        # one that ended before it could be told is told with its end
        ([(0.0, "waiting"), (1.5, ""), (1.6, "nan"), (1.7, ""), (3.0, "")],
         ["waiting", "back", "back; it was for less than 1 s: nan"]),
    ],
)  # fmt: skip
def test_a_condition_is_told_when_it_begins_and_when_it_ends(told, expected):
    lines = Lines()
    log = TransitionLog(lines)
    for at, reason in told:
        log.update("imu", reason, "back", at)
    assert lines == expected


def test_texts_that_differ_in_numbers_are_told_once_in_a_period_and_others_at_once():
    log = RepeatLog()
    lines = [
        log.line(f"it is {age:.3f} s old", 0.1 * age) for age in range(int(30 * REPEAT_PERIOD))
    ]
    told = [line for line in lines if line]
    assert told == [
        "it is 0.000 s old",
        "it is 100.000 s old (99 more since the last line)",
        "it is 200.000 s old (99 more since the last line)",
    ]
    assert log.line("no frame 'odom'", 0.0) and log.line("no frame 'moon'", 0.0)
