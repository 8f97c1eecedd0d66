# SPDX-License-Identifier: Apache-2.0
"""The page of a live rover in a real browser, with simulator and server as nodes."""

import time

import numpy as np
import pytest
from rclpy.parameter import Parameter

from rover_physics.rover.rover_file import load_rover
from rover_physics.terrain.grid import Terrain, save_terrain
from rover_physics.warm_up import warm_up
from rover_planner.nodes.rover_simulator import RoverSimulator
from rover_planner.nodes.traverse_server import TraverseServer
from rover_planner.viewer.live.listener import LiveLink
from rover_planner.viewer.pages.live_page import LivePage
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.browser import Visitor, needs_browser, wait_until

pytestmark = [needs_browser, pytest.mark.slow]

LSR1 = load_rover("lsr1")
AHEAD = (640, 400)
"""A point of the screen on the ground ahead of the rover [px]."""
ASK_AGAIN = 5.0
"""Time after which an unanswered request is repeated [s]."""


@pytest.fixture
def page(ros):
    """A page that follows the graph of the test."""
    warm_up()
    level = Terrain(np.zeros((160, 160)), 0.05, (-4.0, -4.0))
    session = ViewSession(LSR1, level, (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    link = LiveLink(context=ros.context)
    served = LivePage(session, link.listener, port=0)
    yield served
    served.close()
    link.close()


@pytest.fixture
def visitor(page, browser):
    opened = Visitor(browser, page.url)
    yield opened
    opened.tab.close()


def test_a_visitor_watches_a_rover_and_asks_its_server_for_a_plan(ros, page, visitor, tmp_path):
    visitor.wait_for("waiting for odometry")
    wait_until(lambda: "no verdict" in visitor.text("#verdict"), "the missing verdict")
    wait_until(lambda: "map not known yet" in visitor.text("#header"), "the missing map")
    given = LivePage(page.session, page._listener, port=0, has_ground=True)
    try:
        assert given.describe_context()[0].ground == page.session.ground_name == "7.95 x 7.95 m"
    finally:
        given.close()
    empty = visitor.picture()
    save_terrain(tmp_path / "waves.npz", make_terrain(waves))
    values = {"terrain_file": str(tmp_path / "waves.npz"), "start_x": -1.0}
    parameters = [Parameter(name, value=value) for name, value in values.items()]
    simulator = RoverSimulator(context=ros.context, parameter_overrides=parameters)
    ros.spin(simulator)
    ros.spin(TraverseServer(context=ros.context))
    visitor.wait_for("live; forces not known")
    wait_until(lambda: visitor.picture() != empty, "rover and ground in the scene")

    def ask() -> bool:
        """Click again every few seconds: before the server is found a click is refused.

        One that comes before the camera looks at the rover may ask for another place.
        """
        if time.monotonic() - asked[-1] > ASK_AGAIN:
            asked.append(time.monotonic())
            visitor.click_scene(*AHEAD)
        is_answered = visitor.text("#verdict").startswith("traversable")
        return is_answered and "forces predicted by the server" in visitor.text("#dashboard")

    asked = [-ASK_AGAIN]
    wait_until(ask, "the server's verdict and forces")
    visitor.wait_for("live; forces predicted by the server")

    def read_loads() -> list[float] | None:
        text = visitor.text("#dashboard")
        lines = [line for line in text.splitlines() if line.endswith(" N")]
        return None if "? N" in text else [float(line.removesuffix(" N")) for line in lines]

    loads = wait_until(read_loads, "the loads on the dashboard")
    assert sum(loads) == pytest.approx(LSR1.weight, rel=0.05)
    wait_until(lambda: age_of(visitor, "odometry")[1] == "false", "the fresh topic")

    for timer in simulator.timers:  # the simulator falls silent, as if it was killed
        timer.cancel()
    visitor.wait_for("not live: odometry is ")
    wait_until(lambda: age_of(visitor, "odometry")[1] == "true", "the stale topic")
    assert "stale, " in age_of(visitor, "odometry")[0]
    assert age_of(visitor, "/traverse_server/plan")[1] == "false"
    assert visitor.page_errors == []


def age_of(visitor: Visitor, topic: str) -> tuple[str, str]:
    """Return what the page says of a topic's age, and whether it is stale."""
    row = visitor.tab.locator(f'[data-topic="{topic}"]')
    return row.inner_text(), row.get_attribute("data-stale")
