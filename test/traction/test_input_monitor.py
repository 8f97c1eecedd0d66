"""Inputs that are missing, bad or stale are named, in this order."""

from rover_planner.traction.input_monitor import InputMonitor


def test_missing_inputs_are_named_first_then_bad_ones_then_stale_ones():
    monitor = InputMonitor(("a", "b"), 0.1)
    assert monitor.find_fault(0.0) == "waiting for a, b"
    monitor.take("a", 0.0)
    monitor.refuse("b", "b is nan")
    assert monitor.find_fault(0.0) == "b is nan"
    monitor.take("b", 0.05)
    assert monitor.find_fault(0.1) == ""
    assert monitor.find_fault(0.12) == "a stale: none for 100 ms"


def test_an_input_is_fresh_from_its_first_good_message_until_the_timeout():
    monitor = InputMonitor(("a",), 0.1)
    assert not monitor.is_fresh("a", -1e12)
    monitor.take("a", 0.0)
    assert monitor.is_fresh("a", 0.1) and not monitor.is_fresh("a", 0.11)
    monitor.refuse("a", "a is nan")
    assert not monitor.is_fresh("a", 0.0)
