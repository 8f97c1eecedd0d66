# SPDX-License-Identifier: Apache-2.0
"""The page of a live rover, with simulator and server as nodes and without a browser."""

import re

import numpy as np
import pytest
from rclpy.parameter import Parameter

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, save_terrain
from rover_physics.warm_up import warm_up
from rover_planner.nodes.rover_simulator import RoverSimulator
from rover_planner.nodes.traverse_server import TraverseServer
from rover_planner.viewer.live.listener import LiveLink
from rover_planner.viewer.pages.live_page import LivePage
from rover_planner.viewer.state.session import ViewSession
from support import waiting
from support.grounds import make_terrain, waves
from support.viewer.sessions import PATIENCE, ask

pytestmark = pytest.mark.slow

LSR1 = load_rover("lsr1")
LEVEL = Terrain(np.zeros((160, 160)), 0.05, (-4.0, -4.0))


def wait_until(condition, what: str) -> None:
    waiting.wait_until(condition, what, PATIENCE)


@pytest.fixture
def page(ros):
    """A page that follows the graph of the test."""
    warm_up()
    link = LiveLink(context=ros.context)
    served = LivePage(
        ViewSession(LSR1, LEVEL, (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), link.listener, port=0
    )
    yield served
    served.close()
    link.close()


def row_of(page, topic: str) -> str:
    """Return the row of a topic in the list of ages, HTML."""
    found = re.search(f'<div data-topic="{topic}".*?</div>', page.drive_tab._below.content)
    return found.group() if found else ""


def test_a_live_page_shows_a_rover_and_the_plan_and_forces_of_its_server_until_it_falls_silent(
    ros, page, tmp_path
):
    def board() -> str:
        return page.drive_tab._dashboard.content

    wait_until(lambda: "waiting for odometry" in board(), "the missing odometry")
    assert "no verdict" in page.drive_tab._verdict.content
    assert "map not known yet" in page.header._box.content
    save_terrain(tmp_path / "waves.npz", make_terrain(waves))
    values = {"terrain_file": str(tmp_path / "waves.npz"), "start_x": -1.0}
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    simulator = RoverSimulator(context=ros.context, parameter_overrides=parameters)
    ros.spin(simulator)
    ros.spin(TraverseServer(context=ros.context))
    wait_until(lambda: "live; forces not known" in board(), "the rover")
    wait_until(lambda: "elevation_cloud" in page.header._box.content, "the map")

    def is_answered() -> bool:
        """Ask again until the server is found."""
        if page._refusal:
            ask(page, lambda: page.click(np.array([1.0, 0.0]), False))
        return "traversable" in page.header._box.content and "predicted by the server" in board()

    ask(page, lambda: page.click(np.array([1.0, 0.0]), False))
    wait_until(is_answered, "the server's verdict and forces")
    wait_until(lambda: "? N<" not in board(), "the loads on the dashboard")
    loads = [float(load) for load in re.findall(r">([\d.]+) N<", board())]
    assert sum(loads) == pytest.approx(LSR1.weight, rel=0.05)
    wait_until(lambda: 'data-stale="false"' in row_of(page, "odometry"), "the fresh topic")

    for timer in simulator.timers:  # the simulator falls silent, as if it was killed
        timer.cancel()
    wait_until(lambda: "not live: odometry is " in page.header._box.content, "the silence")
    wait_until(lambda: 'data-stale="true"' in row_of(page, "odometry"), "the stale topic")
    assert "stale, " in row_of(page, "odometry") and "grayscale" in board()
    assert 'data-stale="false"' in row_of(page, "/traverse_server/plan")
    assert page.errors.messages == {}


def test_a_page_on_a_given_map_says_so_and_refuses_links(ros):
    link = LiveLink(context=ros.context)
    session = ViewSession(LSR1, LEVEL, (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    page = LivePage(session, link.listener, port=0, has_ground=True)
    try:
        assert page.describe_context()[0].ground == session.ground_name == "7.95 x 7.95 m"
        query = "?rover=lsr1&map=1&start=0,0,0&goal=1,0,0&torques=equal&layer=height"
        ask(page, lambda: page.hear("open", query))
        assert "opens no links" in page._refusal
    finally:
        page.close()
        link.close()
