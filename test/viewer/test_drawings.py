# SPDX-License-Identifier: Apache-2.0
"""The drawings of a verdict: they follow it one by one, and what looks the same is not sent."""

import threading
from dataclasses import replace

import numpy as np
import pytest

from support.viewer.sessions import (
    GOAL,
    LSR1,
    PATIENCE,
    START,
    lowered_reef,
    ramp,
    session_on,
    slow_options,
    tolerant_rover,
)
from support.waiting import start_watch, wait_until

pytest.importorskip("viser", reason="no viser: pip install '.[view]'")

from rover_planner.planning.search.query import LatticeSettings
from rover_planner.viewer.pages import page as page_module
from rover_planner.viewer.pages.base import Drawings
from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.scene.ribbons import Ribbon, Strand
from rover_planner.viewer.scene.rover_visual import RoverVisual
from rover_planner.viewer.state.colours import PASSABLE, REFUSED, UNKNOWN
from rover_planner.viewer.state.failure import explain
from rover_planner.viewer.state.judging import POLICY
from rover_planner.viewer.state.session import ViewSession

MAX_PAUSE = 1.0
"""Longest pause of the playback [s]; without the judgement in its way it is 0.1 s."""


@pytest.fixture(scope="module")
def page():
    """A page without visitors."""
    served = Page(session_on(ramp), port=0)
    yield served
    served.close()


@pytest.fixture(autouse=True)
def at_rest(page):
    """Begin each test with the rover as it was loaded, and nothing to draw."""
    session, asked = page.session, []

    def ask() -> None:
        session.take_rover(LSR1)
        asked.append(session.wanted)

    def is_shown() -> bool:
        return asked and session.shown.answered is asked[0] and not page.is_busy

    page.requests.add(ask)
    wait_until(is_shown, "the rover as it was loaded", PATIENCE)


@pytest.fixture
def drawings(page):
    return Drawings(page.errors, page.server.atomic)


def change_friction(page, friction: float) -> None:
    page.requests.add(lambda: page.session.change_rover([("friction",)], friction))


def test_the_verdict_is_shown_before_its_drawings(page, monkeypatch):
    begun, go_on = threading.Event(), threading.Event()

    def draw_slowly(*arguments) -> None:
        begun.set()
        assert go_on.wait(PATIENCE)

    monkeypatch.setattr(page.scene.paths, "show", draw_slowly)
    change_friction(page, 0.4)
    assert begun.wait(PATIENCE)
    words, chip = page.drive_tab._verdict.content, page.header._box.content
    assert page.is_busy
    go_on.set()
    assert "not traversable" in words and "not traversable" in chip
    wait_until(lambda: not page.is_busy, "the drawings", PATIENCE)


def test_other_policies_are_judged_after_the_drawings(page, monkeypatch):
    judged, drawn, show = [], [], page.scene.paths.show

    def draw_slowly(*arguments) -> None:
        threading.Event().wait(0.05)
        progress = page.session.progress
        judged.append(progress.what if progress else "")
        show(*arguments)
        drawn.append(True)

    monkeypatch.setattr(page_module, "DRAWING_TIME", PATIENCE)  # or it would give up the wait
    monkeypatch.setattr(page.scene.paths, "show", draw_slowly)
    change_friction(page, 0.4)
    wait_until(lambda: drawn, "the paths", PATIENCE)
    assert judged[0] != POLICY
    wait_until(lambda: not page.is_busy, "all policies", PATIENCE)
    assert not any(one.is_old for one in page.session.shown.by_policy)


@pytest.mark.timed
def test_the_rover_drives_on_while_a_change_is_judged_and_drawn():
    options, search = slow_options(1, 3e-4), LatticeSettings(budget=0.1)
    session = ViewSession(tolerant_rover(), lowered_reef(), START, GOAL, options, search)
    page = Page(session, port=0)
    try:
        wait_until(lambda: not page.is_busy, "the ground", PATIENCE)
        page.playback.speed = 1.0
        page.requests.add(page.playback.play)
        change_friction(page, 1.9)
        longest, last, paused = 0.0, page.playback.time, start_watch()

        def is_judged() -> bool:
            nonlocal longest, last, paused
            if page.playback.time != last:
                last, paused = page.playback.time, start_watch()
            longest = max(longest, paused())
            return session.rover.friction == 1.9 and not page.is_busy

        wait_until(is_judged, "the new verdict", PATIENCE)
        assert longest < MAX_PAUSE
    finally:
        page.close()


def test_a_drawing_that_is_asked_for_again_is_done_once_at_its_old_place(drawings):
    done = []
    drawings.ask("the paths", lambda: done.append("old paths"))
    drawings.ask("the plots", lambda: done.append("plots"))
    drawings.ask("the paths", lambda: done.append("new paths"))
    drawings.draw_next()
    assert done == ["new paths"] and drawings.waiting
    drawings.draw_all()
    assert done == ["new paths", "plots"] and not drawings.waiting


def test_a_drawing_that_fails_is_told_and_the_next_one_is_done(page, drawings):
    done = []
    drawings.ask("the paths are not drawn", lambda: 1 / 0)
    drawings.ask("the plots", lambda: done.append("plots"))
    drawings.draw_all()
    assert done == ["plots"] and "ZeroDivisionError" in page.errors.messages.pop(
        "the paths are not drawn"
    )


def test_a_ribbon_that_looks_the_same_is_not_sent_again(page):
    line = np.column_stack([np.linspace(0.0, 1.0, 5), np.zeros(5), np.zeros(5)])
    strands = [Strand(line, PASSABLE, 0.1), Strand(line + 1.0, REFUSED, 0.05)]
    ribbon = Ribbon(page.server.scene, "/test/ribbon")
    ribbon.show(strands)
    band, sent = ribbon._band, ribbon._band.glb_data
    ribbon.show([replace(one, line=one.line.copy()) for one in strands])
    assert ribbon._band is band and band.glb_data is sent
    ribbon.paint(UNKNOWN)
    assert ribbon._band is band and band.glb_data != sent
    assert (ribbon._core.colors == UNKNOWN).all() and ribbon.strands[0].colour == PASSABLE
    ribbon.paint(None)
    assert band.glb_data == sent and (ribbon._core.colors[-1] == REFUSED).all()
    ribbon.show([replace(strands[0], line=line[:3])])
    assert ribbon._band is band and len(ribbon._core.points) == 2
    ribbon.remove()


def test_a_rover_of_another_shape_is_drawn_as_a_new_one(page):
    scene = page.server.scene
    wide = replace(LSR1, wheel=replace(LSR1.wheel, radius=1.3 * LSR1.wheel.radius))
    pivots = {name: (x, 1.2 * y, z) for name, (x, y, z) in LSR1.suspension.wheels.items()}
    wide = replace(wide, suspension=replace(LSR1.suspension, wheels=pivots))
    shaped, new = (
        RoverVisual(scene, rover, page.scene.frame, name)
        for rover, name in ((LSR1, "/test/a"), (wide, "/test/b"))
    )
    shaped.shape(wide)
    assert shaped._meshes.keys() == new._meshes.keys()
    for name, mesh in new._meshes.items():
        np.testing.assert_array_equal(shaped._meshes[name].vertices, mesh.vertices)
        np.testing.assert_array_equal(shaped._meshes[name].faces, mesh.faces)
    for name, joint in new._joints.items():
        np.testing.assert_array_equal(shaped._joints[name].position, joint.position)
    shaped.remove()
    new.remove()


def test_the_ghost_of_a_failure_stays_for_the_next_one_and_hides_without(page):
    session, mark = session_on(ramp), page.scene.failure
    ghosts = []
    for friction in (0.4, 0.35):
        session.change_rover([("friction",)], friction)
        failure = explain(session.shown).failure
        mark.show(session.rover, failure)
        ghosts.append(mark._ghost)
        np.testing.assert_allclose(
            mark._ghost._root.position, page.scene.frame.to_scene(failure.state.position)
        )
    assert ghosts[0] is ghosts[1] and mark._root.visible
    assert [node.name for node in mark._nodes] == ["/failure/outline", "/failure/leader"]
    mark.show(session.rover, None)
    assert not mark._root.visible and not mark._nodes
