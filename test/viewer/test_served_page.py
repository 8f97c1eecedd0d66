# SPDX-License-Identifier: Apache-2.0
"""A served page without a browser: what it tells and draws, errors, links, cameras."""

import json
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from rover_planner.studies.rover_values import write_rover
from rover_planner.viewer.pages.sharing import read_link, write_link
from support.grounds import make_terrain, waves
from support.viewer.sessions import FAR, LSR1, PATIENCE, ask, held, ramp, session_on, wait_for_rest
from support.viewer.sessions import wait_patiently as wait_until

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_planner.viewer.documents.paths import FULL_TURN
from rover_planner.viewer.pages import base, sharing
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.scene.canvas import Canvas, Strand
from rover_planner.viewer.scene.drawn_rover import DrawnRover
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, UNKNOWN
from rover_planner.viewer.state.judging import PATH

pytestmark = pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
FRICTION = "friction [-]"


@pytest.fixture(scope="module")
def served():
    page = Page(session_on(ramp))
    yield page
    page.close()


@pytest.fixture
def page(served) -> Page:
    """A page without visitors, at rest with the rover as it was loaded."""
    ask(served, lambda: served.session.take_rover(LSR1))
    wait_for_rest(served)
    return served


def told(page: Page, name: str):
    """Return a part that the page tells."""
    return page.channel.parts.get(name)


def set_friction(page: Page, friction: float) -> None:
    """Change the friction as a slider does, and wait until that is judged and shown."""
    page.hear({"ask": "value", "label": FRICTION, "value": friction})
    wait_until(lambda: page.session.wanted.rover.friction == friction, "the value")
    wait_for_rest(page)


# The channel.


def test_a_browser_gets_the_files_and_all_parts_at_once_and_then_those_that_change(page):
    with connect(f"ws{page.url[4:]}/channel", origin=page.url) as browser:
        parts = json.loads(browser.recv(timeout=PATIENCE))
        assert {"program", "scene", "subject", "verdict", "paths", "limits", "board"} <= set(parts)
        browser.send(json.dumps({"ask": "value", "label": FRICTION, "value": 0.3}))
        while "verdict" not in (news := json.loads(browser.recv(timeout=PATIENCE))):
            assert "sliders" not in news
        while parts["verdict"]["passes"]:
            parts |= json.loads(browser.recv(timeout=PATIENCE))
        assert parts["verdict"]["headline"].startswith("friction ")


@pytest.mark.parametrize("words", ["no JSON", "[1]", "[" * 100_000, '{"ask": ["seek"]}', b"\xff"])
def test_what_is_no_question_ends_no_channel(page, words):
    with connect(f"ws{page.url[4:]}/channel", origin=page.url) as browser:
        browser.recv(timeout=PATIENCE)
        browser.send(words)
        browser.send(json.dumps({"ask": "value", "label": FRICTION, "value": 0.5}))
        while "verdict" not in json.loads(browser.recv(timeout=PATIENCE)):
            pass


def test_another_site_gets_no_channel(page):
    with pytest.raises(InvalidStatus, match="403"):
        connect(f"ws{page.url[4:]}/channel", origin="http://elsewhere.example")


# What is told and drawn.


def test_numbers_and_joints_have_sliders_and_a_joint_without_limits_goes_all_around(page):
    for label, value in ((FRICTION, 0.9), ("arm_yaw [rad]", 1.0)):
        page.hear({"ask": "value", "label": label, "value": value})
        wait_until(lambda at=label, to=value: told(page, "values")[at] == to, label)
    free = replace(LSR1, manipulator=replace(LSR1.manipulator, joint_limits=None))
    ask(page, lambda: page.session.take_rover(free))
    rows = {one[0]: one for part in told(page, "sliders") for one in part["sliders"]}
    assert rows["arm_yaw [rad]"][1:3] == [-FULL_TURN, FULL_TURN]


def test_a_rover_file_and_a_preset_are_loaded_and_the_arm_follows(page):
    text = write_rover(replace(LSR1, name="bare", manipulator=None))
    page.hear({"ask": "upload", "name": "bare.yaml", "text": text})

    def meshes() -> dict:
        return page.scene.rover.meshes

    wait_until(lambda: told(page, "chosen")["preset"] == "bare", "the loaded rover")
    wait_until(lambda: "arm" not in meshes() and "body" in meshes(), "no arm")
    page.hear({"ask": "preset", "name": "lsr1"})
    wait_until(lambda: "arm" in meshes(), "the arm")
    titles = [part["title"] for part in told(page, "sliders")]
    assert titles[-1] == "Arm"


def test_while_a_change_is_judged_the_verdict_and_the_paths_are_grey_and_it_can_be_cancelled(page):
    session, shown = page.session, page.session.shown
    with held(page.session):
        page.hear({"ask": "value", "label": FRICTION, "value": 0.75})
        wait_until(lambda: told(page, "verdict")["judging"], "the notice")
        assert told(page, "verdict")["old"].startswith("judging path")
        assert session.shown is shown
        every = frozenset(range(len(session.shown.paths)))
        wait_until(lambda: page.scene.paths._old == every, "grey paths")
        page.hear({"ask": "cancel"})
        wait_until(lambda: session.is_stopped, "the end of the work")
    wait_until(lambda: told(page, "verdict")["stopped"], "the button to judge again")
    waits = {row["waits"] for row in told(page, "paths")["rows"]}
    assert waits == {"old, was not judged again"}
    page.hear({"ask": "judge"})
    wait_for_rest(page)
    wait_until(lambda: not told(page, "verdict")["old"], "the new verdict")
    assert session.shown.scenario.rover.friction == 0.75 and not page.scene.paths._old


def test_the_verdict_is_told_before_its_drawings_and_policies_are_judged_after_them(
    page, monkeypatch
):
    tell, show, told_at, drawn = page.channel.tell, page.scene.paths.show, {}, []

    def tell_and_note(name: str, part) -> None:
        told_at.setdefault(name, time.monotonic())
        tell(name, part)

    def draw_and_note(*arguments) -> None:
        drawn.append((time.monotonic(), page._judging.progress))
        show(*arguments)

    monkeypatch.setattr(base, "DRAWING_TIME", PATIENCE)  # or it would give up the wait
    monkeypatch.setattr(page.scene.paths, "show", draw_and_note)
    monkeypatch.setattr(page.channel, "tell", tell_and_note)
    set_friction(page, 0.4)
    at, progress = drawn[0]
    assert at - told_at["limits"] >= base.PERIOD  # a picture of the words comes first
    assert progress is not None and progress.what == PATH
    assert told(page, "verdict")["passes"] is False
    assert not any(one["old"] for one in told(page, "verdict")["policies"])


def test_the_ghost_of_a_failure_stays_for_the_next_one_and_hides_without(page):
    session, scene, canvas = session_on(ramp), page.scene, page.scene.canvas
    ghosts = []
    for friction in (0.4, 0.35):
        session.change_rover([("friction",)], friction)
        failure = session.shown.path.failure
        ask(page, lambda failure=failure: scene.mark_failure(failure))
        ghosts.append(canvas.nodes["/failure/body"])
        there = canvas.to_scene(failure.state.position)
        np.testing.assert_allclose(ghosts[-1].position, there, rtol=1e-6)
    ghost, rovers = canvas.nodes["/failure"], (scene.ghost, scene.rover)
    wheel, own = (canvas.nodes[one.meshes[failure.link][0]] for one in rovers)
    assert ghosts[0] is ghosts[1] and ghost.visible and wheel.color == REFUSED
    ask(page, lambda: scene.show(failure.state, failure))
    assert not ghost.visible and own.opacity == 1.0  # as of what fails
    ask(page, lambda: scene.show(None, failure))
    assert ghost.visible
    ask(page, lambda: scene.mark_failure(None))
    assert not ghost.visible


@pytest.fixture
def drawn(page):
    """A rover that is drawn beside those of a page, in a state; nothing is left of it."""
    rover = DrawnRover(Canvas(page.server.scene), "/test/rover", 0.5)
    rover.take(LSR1, {})
    rover.show(page.session.shown.path.trajectory.state_at(0.0))
    yield rover
    rover._canvas.remove("/test")
    assert rover._canvas.nodes == {}


def test_the_link_that_fails_has_the_colour_of_that_and_its_own_again_where_none_does(drawn):
    meshes = {link: drawn._canvas.nodes[name] for link, (name, _) in drawn.meshes.items()}
    before = {link: mesh.color for link, mesh in meshes.items()}
    for link in ("bogie_left", "body", "front_left"):
        drawn.show(drawn.state, link)
        assert {name for name, mesh in meshes.items() if mesh.color == REFUSED} == {link}
        assert meshes[link].opacity == 1.0
    drawn.show(drawn.state)
    for link, colour in before.items():
        assert meshes[link].color == colour and meshes[link].opacity == 0.5


def test_a_rover_of_another_shape_keeps_the_nodes_that_it_has_too(drawn):
    nodes, suspension = drawn._canvas.nodes, replace(LSR1.suspension, rocker_wheel="front")
    before = dict(nodes)
    drawn.take(replace(LSR1, suspension=suspension, manipulator=None), {})
    stays = {name for name in nodes if nodes[name] is before.get(name)}
    assert "/test/rover/body" in stays and "/test/rover/body/arm" not in nodes
    assert set(before) != set(nodes) and not any(node._impl.removed for node in nodes.values())


def test_a_path_is_drawn_in_the_colour_of_its_verdict_up_to_where_it_is_refused(page):
    session = session_on(ramp)
    session.change_rover([("friction",)], 0.4)
    shown, overlay = session.shown, page.scene.paths
    ask(page, lambda: overlay.show(shown.paths, shown.index))
    driven, beyond, *cross = overlay.paths[shown.index]
    assert driven.colour == REFUSED
    np.testing.assert_array_equal(driven.line[-1], beyond.line[0])
    assert beyond.colour != REFUSED and len(cross) == 2


def to_screen(light) -> np.ndarray:
    """Return the colours that a browser shows for shares of light, by the sRGB standard."""
    share = np.asarray(light) / 255.0
    bright = 1.055 * np.maximum(share, 0.0031308) ** (1 / 2.4) - 0.055
    return 255.0 * np.where(share <= 0.0031308, 12.92 * share, bright)


def test_lines_have_the_colours_of_their_strands_and_their_node_stays_until_it_is_removed(page):
    line = np.column_stack([np.linspace(0.0, 1.0, 5), np.zeros(5), np.zeros(5)])
    strands = [Strand(line, PASSABLE), Strand(line + 1.0, REFUSED)]
    canvas = Canvas(page.server.scene)
    canvas.show_lines("/test/lines", strands, 4.0)
    node = canvas.nodes["/test/lines"]
    for paint, colours in ((UNKNOWN, [UNKNOWN] * 2), (None, [PASSABLE, REFUSED])):
        canvas.show_lines("/test/lines", strands, 4.0, paint)
        np.testing.assert_allclose(to_screen(node.colors[[0, -1], 0]), colours, atol=6.0)
    canvas.show_lines("/test/lines", [replace(strands[0], line=line[:3])], 4.0)
    assert canvas.nodes["/test/lines"] is node and len(node.points) == 2
    canvas.remove("/test")
    assert canvas.nodes == {}


def test_a_trail_has_a_colour_from_blue_to_yellow_at_each_place(page):
    overlay = page.scene.paths
    trail = np.array([[0.0, 0.0, 0.5], [0.1, 0.0, 0.0], [0.2, 0.0, 1.0]])
    for known, count in ((trail[:0], 0), (trail[:1], 0), (trail, 2)):
        overlay.show_trail(known)
        node = page.scene.canvas.nodes.get("/lines/trail")
        assert (0 if node is None else len(node.points)) == count
    low, high = node.colors[:, 0].tolist()
    assert low[2] > low[0] and high[0] > high[2]
    overlay.show_trail(trail[:0])


# Errors.


def test_what_fails_is_told_and_stops_no_other_and_what_is_drawn_is_not_drawn_again(page):
    done, ground, rover = [], object(), object()

    def ask_for_four() -> None:
        page.draw_made("the paths", lambda _: done.append("paths"), ground)
        page.draw_made("the plots", lambda _: 1 / 0, ground)
        page.draw_made("the paths", lambda _: done.append("again"), ground)
        page.draw_made("the rover", lambda *_: done.append("rover"), ground, rover)

    ask(page, ask_for_four)
    assert done == ["paths", "rover"]
    assert "ZeroDivisionError" in page.errors.pop("the plots")
    page.requests.put(lambda: 1 / 0)
    error = ["the last request failed", "ZeroDivisionError: division by zero"]
    wait_until(lambda: told(page, "errors") == [error], "the notice")
    ask(page, lambda: None)
    wait_until(lambda: told(page, "errors") == [], "the notice to go")


def test_a_closed_page_leaves_no_thread_behind():
    before = set(threading.enumerate())
    page = Page(session_on(ramp))
    page.requests.put(page.session.ask)
    page.close()
    left = {thread.name for thread in set(threading.enumerate()) - before}
    assert not left & {"page", "judge", "ground"}


# Cameras, maps.


def test_a_camera_sees_all_of_the_path_from_behind_or_above_and_the_rover_from_its_side(page):
    place = {"position": np.zeros(3), "look_at": np.ones(3)}
    camera = SimpleNamespace(fov=1.0, image_width=600, image_height=600, **place)
    client, path = SimpleNamespace(camera=camera), page.scene.path_places
    middle = 0.5 * (path.min(axis=0) + path.max(axis=0))
    away = {}
    for view in ("Fit", "Top", "Side"):
        page.scene.look(view, [client])
        away[view] = client.camera.position - client.camera.look_at
        if view != "Side":
            np.testing.assert_allclose(client.camera.look_at[:2], middle, atol=1e-6)
    assert away["Top"][2] > 10.0 * np.hypot(*away["Top"][:2])
    assert away["Side"][1] < -2.0 * max(abs(away["Side"][0]), away["Side"][2])
    assert np.linalg.norm(away["Fit"]) > np.linalg.norm(away["Side"])


def test_on_a_far_map_the_rover_is_where_it_is_on_a_near_one_and_a_click_lands_where_it_is_aimed():
    places = {}
    for x, y in ((0.0, 0.0), FAR):
        ground = make_terrain(waves)
        ground = replace(ground, origin=(ground.origin[0] + x, ground.origin[1] + y))
        page = Page(session_on(ground, (x - 2.0, y, 0.0), (x + 1.0, y, 0.0)))
        try:
            wait_for_rest(page)
            places[x] = np.array(page.scene.canvas.nodes["/rover/body"].position)
            aim = np.array([x + 1.5, y + 0.5])
            place = page.scene.canvas.to_scene([*aim, float(ground.elevation_at(*aim))])
            away = np.array([-1.0, 0.0, 2.0])
            ray = SimpleNamespace(ray_origin=place + away, ray_direction=-away / np.sqrt(5.0))
            page._request_click(ray, shift=False)
            wait_until(lambda p=page, x=x: p.session.wanted.goal[0] != x + 1.0, "a goal")
            np.testing.assert_allclose(page.session.wanted.goal[:2], aim, atol=0.05)
        finally:
            page.close()
    np.testing.assert_allclose(places[FAR[0]], places[0.0], atol=1e-6)


# Links.


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"ground": "00000000"}, "the link is about another map"),
        ({"policy": "magic"}, "no torque policy 'magic'; policies are equal, servo, optimal"),
        ({"soil": "mud"}, "no soil 'mud'; soils are "),
        ({"joints": {"wing": 1.0}}, "the link turns the joint 'wing', which lsr1 lacks"),
        ({"layer": "gold"}, "the link names the layer 'gold'"),
    ],
)
def test_a_link_with_unknown_names_is_refused_and_nothing_else_changes(page, change, reason):
    wanted = page.session.wanted
    query = write_link(replace(page._link(), **change))
    page.hear({"ask": "open", "query": f"?{query}"})
    wait_until(lambda: page.session.refusal.startswith(reason), "the reason")
    assert page.session.wanted is wanted and page.errors == {}


def test_a_link_that_would_be_longer_than_an_address_may_be_is_refused(page, monkeypatch):
    monkeypatch.setattr(sharing, "MAX_LENGTH", 100)
    page.hear({"ask": "link"})
    wait_until(lambda: "link with the file of lsr1" in page.session.refusal, "the reason")
    assert write_link(page._link()) == ""


def test_path_and_time_of_a_link_come_with_its_paths_and_not_with_a_later_goal(page):
    link = replace(page._link(), goal=(1.0, 0.5, 0.1), path=4, time=20.0)
    ask(page, lambda: page._open(link))
    wait_until(lambda: page.session.shown.index == 3, "the path")
    wait_until(lambda: abs(page.playback.time - 20.0) < 1e-6, "the time")
    link = replace(page._link(), goal=(-2.0, 0.0, 0.0), path=5)
    ask(page, lambda: page._open(link))
    wait_for_rest(page)
    assert len(page.session.shown.paths) < 5  # it stays where it is: nothing to choose from
    ask(page, lambda: page.session.plan_to(np.array([1.0, 0.5])))
    wait_for_rest(page)
    assert page.session.shown.index == page.session.shown.best != 4 and page.playback.time == 0.0


def test_a_program_that_was_started_again_takes_up_the_link_that_the_last_one_told(page):
    set_friction(page, 0.7)
    wait_until(lambda: read_link(told(page, "current")).rover["friction"] == 0.7, "the link")
    assert told(page, "subject")["rover"] == "lsr1 (changed)" and told(page, "limits")["compared"]
    again = Page(session_on(ramp))
    try:
        assert told(again, "program") != told(page, "program")
        again.hear({"ask": "open", "query": f"?{told(page, 'current')}"})
        wait_until(lambda: again.session.shown.scenario.rover.friction == 0.7, "the rover")
    finally:
        again.close()
