# SPDX-License-Identifier: Apache-2.0
"""The watchdog acts while no command is valid, and lets no late command through."""

import threading
import time

import pytest

from rover_planner.traction.watchdog import Watchdog
from support.waiting import wait_until

LATE = 0.1
"""Delay of a thread that a busy machine may cause [s]."""


@pytest.fixture
def acted():
    return []


@pytest.fixture
def watchdog(acted):
    dog = Watchdog(lambda: acted.append(time.monotonic()))
    yield dog
    dog.close()


@pytest.mark.timed
def test_it_acts_again_and_again_from_the_deadline_on(watchdog, acted):
    now = time.monotonic()
    assert watchdog.send(lambda: None, now, now + 0.05)
    wait_until(lambda: len(acted) >= 3, "the watchdog")
    assert 0.0 <= acted[0] - (now + 0.05) < LATE
    assert watchdog.trips == 1


def test_a_command_that_was_begun_before_it_acted_is_not_sent(watchdog, acted):
    started, sent = time.monotonic(), []
    watchdog.send(lambda: None, started, started)
    wait_until(lambda: acted, "the watchdog")
    assert not watchdog.send(lambda: sent.append(1), started, started + 1.0) and not sent
    now = time.monotonic()
    wait_until(
        lambda: watchdog.send(lambda: sent.append(2), time.monotonic(), now + 9.0), "a new one"
    )
    assert sent == [2] and watchdog.trips == 1


def test_it_acts_while_a_thread_hangs_in_a_sending_which_does_not_count_and_goes_on(
    watchdog, acted
):
    go_on, sent = threading.Event(), []
    now = time.monotonic()
    watchdog.send(lambda: None, now, now + 0.02)
    thread = threading.Thread(
        target=lambda: sent.append(watchdog.send(go_on.wait, time.monotonic(), now + 999.0))
    )
    thread.start()
    try:
        wait_until(lambda: acted, "the watchdog")
    finally:
        go_on.set()
        thread.join()
    assert sent == [False]
    acted.clear()
    wait_until(lambda: acted, "the watchdog once more")


def test_an_error_while_it_acts_does_not_end_it(capfd):
    calls = []

    def act():
        calls.append(1)
        raise RuntimeError("no publisher")

    dog = Watchdog(act)
    now = time.monotonic()
    dog.send(lambda: None, now, now)
    wait_until(lambda: len(calls) >= 2, "the second try")
    dog.close()
    assert "no publisher" in capfd.readouterr().err
