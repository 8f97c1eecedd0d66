# SPDX-License-Identifier: Apache-2.0
"""A mapped server that the tests of a file share.

Its log goes silent where another server in this process ends: tests with servers of their own come
first in a file.
"""

import threading
from types import SimpleNamespace

import numpy as np
import pytest

from support.grounds import make_terrain, waves
from support.planner_client import PlannerClient, spin_server
from support.ros_fixtures import RosRun

WAVES = make_terrain(waves)


@pytest.fixture(scope="module")
def shared_nodes():
    """Return ROS, a server and its client."""
    ros = RosRun()
    server, client = spin_server(ros, planner="fan"), ros.spin(PlannerClient(ros))
    yield SimpleNamespace(ros=ros, server=server, client=client)
    ros.close()


@pytest.fixture
def shared(shared_nodes):
    """Return them with a passable map; a test leaves the parameters as they were."""
    terrain = shared_nodes.server.service.terrain
    if terrain is None or not np.allclose(terrain.elevation, WAVES.elevation):
        shared_nodes.client.send_terrain(WAVES)
    shared_nodes.client.logs.clear()
    return shared_nodes


@pytest.fixture
def hold(monkeypatch):
    """Return a function that has a method wait; it returns what tells of a call and ends waits."""

    def hold_calls(kind, name):
        call, began, go_on = getattr(kind, name), threading.Event(), threading.Event()

        def wait(*given):
            began.set()
            assert go_on.wait(60.0)
            return call(*given)

        monkeypatch.setattr(kind, name, wait)
        return began, go_on

    return hold_calls
