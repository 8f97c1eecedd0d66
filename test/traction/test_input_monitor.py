"""Inputs that are missing, bad or stale are named, in this order."""

import pytest

from rover_planner.traction.input_monitor import InputMonitor


def test_missing_inputs_are_named_first_then_bad_ones_then_stale_ones():
    monitor = InputMonitor({"a": 0.1, "b": 0.1})
    assert monitor.find_fault(0.0) == "waiting for a, b"
    monitor.take("a", 0.0)
    monitor.refuse("b", "b is nan")
    assert monitor.find_fault(0.0) == "b is nan"
    monitor.take("b", 0.05)
    assert monitor.find_fault(0.1) == ""
    assert monitor.find_fault(0.12) == "a stale: none for 100 ms"


def test_an_input_is_fresh_from_its_first_good_message_until_the_timeout():
    monitor = InputMonitor({"a": 0.1})
    assert not monitor.is_fresh("a", -1e12)
    monitor.take("a", 0.0)
    assert monitor.is_fresh("a", 0.1) and not monitor.is_fresh("a", 0.11)
    monitor.refuse("a", "a is nan")
    assert not monitor.is_fresh("a", 0.0)


def test_each_input_has_a_timeout_of_its_own():
    monitor = InputMonitor({"joints": 0.07, "command": 0.5})
    monitor.take("joints", 0.0)
    monitor.take("command", 0.0)
    assert monitor.expiry == pytest.approx(0.07)
    monitor.take("joints", 0.4)
    assert monitor.find_fault(0.45) == ""
    monitor.take("joints", 0.52)
    assert monitor.find_fault(0.52) == "command stale: none for 500 ms"


def test_a_refusal_ends_with_an_input_that_was_measured_later():
    monitor = InputMonitor({"a": 0.1})
    monitor.refuse("a", "a is nan", 1.0)
    monitor.take("a", 0.99)
    assert monitor.find_fault(1.0) == "a is nan"
    monitor.take("a", 1.01)
    assert monitor.find_fault(1.01) == ""


def test_why_messages_were_not_used_is_told_with_the_fault():
    monitor = InputMonitor({"a": 0.1})
    monitor.ignore("a", "stamps do not advance")
    assert monitor.find_fault(0.0) == "waiting for a (stamps do not advance)"
    monitor.take("a", 0.0)
    monitor.ignore("a", "stamps do not advance")
    assert monitor.find_fault(0.05) == ""
    assert monitor.find_fault(0.2) == "a stale: none for 100 ms (stamps do not advance)"
