# SPDX-License-Identifier: Apache-2.0
"""Changes on a page without a browser: marks, undo, files, links, old verdicts, cameras, maps."""

import re
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

import pytest

from rover_physics.rover.rover_file import load_rover
from rover_planner.studies.rover_values import write_rover
from rover_planner.viewer.browser.link import PageLink
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.panel.rover_tab import CHANGED
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.sessions import (
    FAR,
    LSR1,
    PATIENCE,
    ask,
    held,
    ramp,
    session_on,
    shift,
    wait_for_rest,
)
from support.waiting import wait_until

FRICTION = "friction [-]"


@pytest.fixture(scope="module")
def served() -> Iterator[Page]:
    page = Page(session_on(ramp), port=0)
    yield page
    page.close()


@pytest.fixture
def page(served) -> Page:
    """A page without visitors, at rest with the rover as it was loaded."""
    ask(served, lambda: served._load(lambda: load_rover("lsr1")))
    wait_for_rest(served)
    return served


def change_friction(page: Page, friction: float) -> None:
    """Change the friction as a slider does."""
    value = next(value for value in page.rover_tab.sliders if value.label == FRICTION)
    ask(page, lambda: page._change_value(value, friction))


def labels_of(page: Page) -> set[str]:
    return {slider.label for slider in page.rover_tab.sliders.values()}


def test_a_changed_number_is_marked_with_what_it_changes_and_can_be_undone_and_reset(page):
    for friction in (0.75, 0.7):
        change_friction(page, friction)
        wait_for_rest(page)
    assert f"{CHANGED}{FRICTION}" in labels_of(page)
    assert "lsr1 (changed)" in page.header._box.content
    text = re.sub(r"<[^>]*>", " ", page.rover_tab._changes.content)
    assert re.search(r"friction\s+0.8\s+0.7\s+-0.1", text) and "friction, largest" in text
    curves = page.plots.curves["friction_utilisation"][1]
    assert (curves[:, :6] != curves[:, 6:]).any()  # those of the rover before
    for undo, friction in ((page._undo, 0.75), (lambda: page._restore(LSR1, {}), 0.8)):
        ask(page, undo)
        wait_for_rest(page)
        assert page.session.rover.friction == friction
        values = {one.label: slider.value for one, slider in page.rover_tab.sliders.items()}
        assert values[FRICTION] == friction
    assert f"{CHANGED}{FRICTION}" not in labels_of(page)


@pytest.mark.long  # a browser drags a few of them in test_page
def test_sliders_at_both_ends_leave_the_page_without_an_error(page):
    for value in list(page.rover_tab.sliders):
        for number in (value.low, value.high):
            ask(page, lambda value=value, number=number: page._change_value(value, number))
            wait_for_rest(page)
            assert page.errors.messages == {}, value.label
        ask(page, lambda: page._restore(LSR1, {}))


def test_a_rover_file_is_loaded_and_presets_and_arm_follow(page):
    text = write_rover(replace(LSR1, name="bare", manipulator=None))
    file = SimpleNamespace(name="bare.yaml", content=text.encode())
    page.rover_tab._load_file(SimpleNamespace(target=SimpleNamespace(value=file)))

    def nodes() -> dict:
        return {} if page.scene._visual is None else page.scene._visual._meshes

    wait_until(lambda: page.session.rover.name == "bare", "the loaded rover", PATIENCE)
    wait_until(lambda: "arm" not in nodes() and "body" in nodes(), "no arm", PATIENCE)
    assert page.rover_tab._preset.value == "bare (file)" and not page.rover_tab.arm
    chosen = SimpleNamespace(target=SimpleNamespace(value="lsr1"), client=object())
    page.rover_tab._load_preset(chosen)
    wait_until(lambda: "arm" in nodes(), "the arm", PATIENCE)
    assert page.rover_tab._preset.value == "lsr1" and len(page.rover_tab.arm) == 3


def test_while_a_change_is_judged_the_old_verdict_is_grey_and_it_can_be_cancelled(page):
    session, shown, notice = page.session, page.session.shown, page._panels.notice
    verdict = lambda: page.rover_tab._verdict.content  # noqa: E731
    with held(session._background):
        change_friction(page, 0.75)
        wait_until(lambda: notice._cancel.visible, "the notice", PATIENCE)
        assert "judging path" in notice._text.content and "old values</b>: judging" in verdict()
        wait_until(lambda: "(old values)" in page.header._box.content, "the chip", PATIENCE)
        assert session.shown is shown
        grey = set(range(len(session.shown.candidates)))
        wait_until(lambda: page.scene.paths._old == grey, "grey paths", PATIENCE)
        ask(page, page._cancel)
        wait_until(lambda: session.is_stopped, "the end of the work", PATIENCE)
    wait_until(lambda: notice._again.visible, "the button to judge again", PATIENCE)
    assert "the judgement was stopped" in verdict()
    ask(page, page._judge_again)
    wait_for_rest(page)
    wait_until(lambda: "old values" not in verdict(), "the new verdict", PATIENCE)
    assert session.rover.friction == 0.75 and not page.scene.paths._old


def make_client() -> SimpleNamespace:
    """Return what the page needs of a visitor's client of viser."""
    place = {"position": np.zeros(3), "look_at": np.ones(3)}
    camera = SimpleNamespace(fov=1.0, image_width=600, image_height=600, **place)
    return SimpleNamespace(camera=camera)


def test_a_camera_sees_all_of_the_path_from_behind_or_above_and_the_rover_from_its_side(page):
    client, path = make_client(), page.path_to_look_at()
    middle = 0.5 * (path.min(axis=0) + path.max(axis=0))
    away = {}
    for view in ("Fit", "Top", "Side"):
        page._look(client, view)
        away[view] = client.camera.position - client.camera.look_at
        if view != "Side":
            np.testing.assert_allclose(client.camera.look_at[:2], middle, atol=1e-6)
    assert away["Top"][2] > 10.0 * np.hypot(*away["Top"][:2])
    assert away["Side"][1] < -2.0 * max(abs(away["Side"][0]), away["Side"][2])
    assert np.linalg.norm(away["Fit"]) > np.linalg.norm(away["Side"])


def test_cameras_go_along_with_the_rover_until_they_stay(page, monkeypatch):
    client = make_client()
    monkeypatch.setattr(page.server, "get_clients", lambda: {0: client})
    ask(page, lambda: page.playback.go_to(0.0))
    ask(page, lambda: page._follow(client, "Follow"))
    first = page.scene._last_position
    np.testing.assert_allclose(client.camera.look_at, page.scene.frame.to_scene(first))
    before = client.camera.position
    ask(page, page.playback.play)
    wait_until(lambda: client.camera.position[0] > before[0] + 0.3, "the camera", PATIENCE)
    ask(page, lambda: page._follow(client, "Stay"))
    ask(page, page.playback.pause)
    assert page._camera.options[-1] == "Follow" and not page.scene.cameras.follows


def test_on_a_far_map_the_rover_is_where_it_is_on_a_near_one_and_a_click_lands_where_it_is_aimed():
    places = {}
    for x, y in ((0.0, 0.0), FAR):
        ground = shift(make_terrain(waves), (x, y))
        page = Page(ViewSession(LSR1, ground, (x - 2.0, y, 0.0), (x + 1.0, y, 0.0)), port=0)
        try:
            wait_for_rest(page)
            places[x] = np.array(page.scene._visual._root.position)
            aim = np.array([x + 1.5, y + 0.5])
            place = page.scene.frame.to_scene([*aim, float(ground.elevation_at(*aim))])
            away = np.array([-1.0, 0.0, 2.0])
            ray = SimpleNamespace(ray_origin=place + away, ray_direction=-away / np.sqrt(5.0))
            page._request_click(ray, shift=False)
            wait_until(lambda: page.session.scenario.goal[0] != x + 1.0, "a goal", PATIENCE)  # noqa: B023
            np.testing.assert_allclose(page.session.scenario.goal[:2], aim, atol=0.05)
        finally:
            page.close()
    np.testing.assert_allclose(places[FAR[0]], places[0.0], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"ground": "00000000"}, "the link is about another map"),
        ({"policy": "magic"}, "no torque policy 'magic'; policies are equal, servo, optimal"),
        ({"soil": "mud"}, "no soil 'mud'; soils are "),
        ({"joints": {"wing": 1.0}}, "the link turns the joint 'wing', which lsr1 lacks"),
    ],
)
def test_a_link_with_unknown_names_is_refused_and_nothing_else_changes(page, change, reason):
    wanted, shown = page.session.wanted, []
    choose = page.ground_tab.show_options
    page.ground_tab.show_options = lambda options: (shown.append(options), choose(options))
    link: PageLink = replace(page.sharing.make_link(), **change)
    ask(page, lambda: page.open_link(link))
    assert page.session.refusal.startswith(reason)
    assert page.session.wanted is wanted and page.errors.messages == {}
    assert shown == []


def test_path_and_time_of_a_link_to_fewer_paths_do_not_come_with_a_later_goal(page):
    link = replace(page.sharing.make_link(), goal=(-2.0, 0.0, 0.0), path=5, time=20.0)
    ask(page, lambda: page.open_link(link))
    wait_for_rest(page)
    assert len(page.session.shown.candidates) < 5  # it stays where it is: nothing to choose from
    ask(page, lambda: page.plan(np.array([1.0, 0.5])))
    wait_for_rest(page)
    assert page.session.shown.index == page.session.shown.answer.nearest != 4
    assert page.playback.time == 0.0


def test_path_and_time_of_a_link_come_with_its_paths(page):
    link = replace(page.sharing.make_link(), goal=(1.0, 0.5, 0.1), path=4, time=20.0)
    ask(page, lambda: page.open_link(link))
    wait_until(lambda: page.session.shown.index == 3, "the path", PATIENCE)
    wait_until(lambda: page.playback.time == 20.0, "the time", PATIENCE)
