# SPDX-License-Identifier: Apache-2.0
"""The page of a live rover, with simulator and server as nodes and without a browser."""

import numpy as np
import pytest

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_physics.terrain.grid import save_terrain
from rover_physics.warm_up import warm_up
from rover_planner.nodes.rover_simulator import RoverSimulator
from rover_planner.nodes.traverse_server import TraverseServer
from rover_planner.viewer.live.listener import listen
from rover_planner.viewer.pages.live_page import LivePage
from rover_planner.viewer.pages.sharing import PageLink, write_link
from rover_planner.viewer.state.colours import UNKNOWN, to_linear
from support.grounds import make_terrain, plane, waves
from support.viewer.sessions import LSR1, ask
from support.viewer.sessions import wait_patiently as wait_until

pytestmark = pytest.mark.slow

DRIVE = {"start": (0.0, 0.0, 0.0), "goal": (1.0, 0.0, 0.0), "path": 1, "time": 0.0}
LINK = PageLink(loaded={}, rover={}, ground="0", policy="equal", soil="", **DRIVE)
PLAN = "/lines/plan"


@pytest.fixture
def page(ros):
    """A page that follows the graph of the test."""
    warm_up()
    with listen(ros.context) as listener:
        served = LivePage(LSR1, plane(0.0, 0.0, half=4.0), listener)
        yield served
        served.close()


def test_a_live_page_shows_a_rover_and_the_plan_and_forces_of_its_server_until_they_fall_silent(
    ros, page, tmp_path
):
    def told(name: str):
        return page.channel.parts.get(name)

    def words() -> str:
        return told("drive")["words"]

    def topic(name: str) -> dict:
        return next(one for one in told("topics") if one["topic"] == name)

    wait_until(lambda: told("drive") and "waiting for odometry" in words(), "no odometry")
    assert told("verdict")["passes"] is None and told("board") is None
    assert told("subject")["map"] == "not known yet"
    save_terrain(tmp_path / "waves.npz", make_terrain(waves))
    ground = str(tmp_path / "waves.npz")
    simulator = ros.start(RoverSimulator, terrain_file=ground, start_x=-1.0)
    server = ros.start(TraverseServer)
    wait_until(lambda: "live; forces not known" in words(), "the rover")
    wait_until(lambda: told("subject")["map"] == "elevation_cloud", "the map")
    ask(page, lambda: page.hear({"ask": "open", "query": f"?{write_link(LINK)}"}))
    wait_until(lambda: "opens no links" in told("verdict")["refusal"], "the refused link")

    def is_answered() -> bool:
        """Ask again until the server is found, and has the map."""
        if page._refusal or told("verdict")["passes"] is False:
            ask(page, lambda: page.click(np.array([1.0, 0.0]), False))
        return told("verdict")["passes"] is True and "predicted by the server" in words()

    wait_until(is_answered, "the server's verdict and forces")
    assert told("verdict")["about"].startswith("your click, ")
    wait_until(lambda: told("board")["wheels"][0]["load"] != "?", "the loads on the board")
    loads = [float(wheel["load"].split()[0]) for wheel in told("board")["wheels"]]
    assert sum(loads) == pytest.approx(LSR1.weight, rel=0.05)
    assert not topic("odometry")["stale"] and words().startswith("live")
    wait_until(lambda: PLAN in page.scene.canvas.nodes, "the plan")
    ask(page, lambda: page.click(np.array([3.9, 0.0]), False))
    wait_until(lambda: told("verdict")["passes"] is False, "the refusal of what is off the map")
    wait_until(lambda: PLAN not in page.scene.canvas.nodes, "no plan")
    ask(page, lambda: page.click(np.array([1.0, 0.0]), False))
    wait_until(lambda: PLAN in page.scene.canvas.nodes, "the plan again")
    page.hear({"ask": "newest"})
    wait_until(lambda: told("verdict")["about"].startswith("question"), "the newest verdict")

    for timer in server.timers:  # the server falls silent, as if it was killed
        timer.cancel()
    wait_until(lambda: told("verdict")["old"].startswith("the server is silent"), "its silence")
    assert "the server is silent" in told("subject")["mode"]
    grey = to_linear(np.array(UNKNOWN))
    wait_until(lambda: (page.scene.canvas.nodes[PLAN].colors == grey).all(), "the grey plan")
    for timer in simulator.timers:
        timer.cancel()
    wait_until(lambda: "not live: odometry is " in told("subject")["mode"], "the silence")
    wait_until(lambda: topic("odometry")["stale"], "the stale topic")
    wait_until(lambda: told("board")["wheels"][0]["load"] == "?", "no forces")
    assert not topic("/traverse_server/plan")["stale"] and page.errors == {}
