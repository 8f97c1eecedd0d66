# SPDX-License-Identifier: Apache-2.0
"""What all tests share: a ROS that stays on this machine, a server and its client."""

import contextlib
import gc
import os
import signal
from functools import partial

import pytest
from hypothesis import settings

os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
gc.disable()  # until the tests are collected: to look for garbage takes a seventh of the time
settings.register_profile("untimed", deadline=None, max_examples=30)  # a machine may be busy
settings.load_profile("untimed")
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell's background job ignores it, and so would every child that a test interrupts.
    signal.signal(signal.SIGINT, signal.default_int_handler)

LONGEST = (
    "test_page", "test_docs_blocks", "test_session", "test_mission_planner", "test_demo",
    "test_served_page", "test_paths_around", "test_path_search", "test_warm_up", "test_simulator",
    "test_advice", "test_reachable", "test_parts_of_paths", "test_survey_command",
)  # fmt: skip
"""Files that take longest. They begin first, so that none is left alone on one core at the end."""


def pytest_runtest_logreport(report):
    """Name a failure at once: a run that is cut short prints no summary."""
    if report.failed and "PYTEST_XDIST_WORKER" not in os.environ:
        words = report.longreprtext.strip().splitlines() or [""]
        print(f"\nFAILED {report.nodeid} ({report.when}): {words[-1]}", flush=True)


def pytest_collection_modifyitems(items):
    """Put the files that take longest in front; the others keep their order."""
    last = len(LONGEST)
    rank = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.stem, last))


def pytest_collection_finish():
    """Look for garbage from now on, but not among what collecting has made."""
    gc.freeze()
    gc.enable()


@pytest.fixture
def ros():
    """Return a ROS context of the test's own; nodes spin in the background and end with it."""
    from support.ros_fixtures import RosRun

    run = RosRun()
    yield run
    run.close()


@pytest.fixture
def client(ros):
    """Return the other side of the traverse server's contract."""
    from support.planner_client import PlannerClient

    return ros.spin(PlannerClient(ros))


@pytest.fixture
def start_server(ros):
    """Return a function that starts a traverse server with parameters.

    Questions have more time than by default, so that a busy machine makes no difference.
    """
    from support.planner_client import spin_server

    return partial(spin_server, ros)


@pytest.fixture
def endless():
    """Return a context in which the work on plans goes on until it is stopped."""
    from rover_planner.planning.answering.snapshot import Snapshot

    find = Snapshot.answer

    def find_for_ever(snapshot, *asked):
        while True:
            find(snapshot, *asked)

    @contextlib.contextmanager
    def work_for_ever():
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Snapshot, "answer", find_for_ever)
            yield

    return work_for_ever


@pytest.fixture
def lasting(monkeypatch):
    """Let a measurement count as one of now for a minute: a late thread changes nothing."""
    from rover_planner.planning.answering.traverse_service import TraverseService

    monkeypatch.setattr(TraverseService._is_recent, "__kwdefaults__", {"max_age": 60.0})
    monkeypatch.setattr(TraverseService.fresh_pose, "__defaults__", (60.0,))


@pytest.fixture
def server(start_server):
    """Return a traverse server without a map."""
    return start_server()
