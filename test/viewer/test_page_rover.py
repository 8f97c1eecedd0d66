# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: numbers of the rover, files, studies, judging in the background."""

import re
from dataclasses import replace

import pytest

from rover_physics.rover.rover_file import load_rover
from rover_planner.studies.example_studies import find_examples
from rover_planner.studies.rover_values import read_rover, write_rover
from rover_planner.studies.runner import find_rover, run_study
from rover_planner.studies.study_file import load_study
from rover_planner.viewer.pages import page as page_module
from rover_planner.viewer.panel.controls import CHANGED
from support.viewer.browser import WAIT, Visitor, needs_browser, wait_until
from support.viewer.sessions import LSR1, ask, held, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow]

FRICTION, COM, FRONT = "friction [-]", "body centre x [m]", "front wheel x [m]"


@pytest.fixture
def applied(visitor, page, monkeypatch) -> list[float]:
    """Return a list that gets all values that the page applies, with the tab of the rover."""
    values: list[float] = []
    change = page.session.change_rover

    def note(keys, value):
        values.append(value)
        return change(keys, value)

    monkeypatch.setattr(page.session, "change_rover", note)
    visitor.open_tab("Rover")
    return values


# Boxes and sliders.


def test_a_typed_number_counts_on_enter_or_when_the_box_is_left_and_not_at_each_key(
    visitor, page, applied
):
    visitor.type_keys(FRICTION, "0.55")
    visitor.tab.wait_for_timeout(400)
    assert applied == [] and page.session.wanted.rover.friction == LSR1.friction
    visitor.tab.keyboard.press("Enter")
    wait_until(lambda: applied == [0.55], "the value")
    visitor.press("Masses")
    visitor.type_keys(COM, "-0.05", "Tab")
    wait_until(lambda: applied[1:] == [-0.05], "the value")
    wait_for_rest(page)
    assert page.session.rover.friction == 0.55
    assert page.session.rover.masses.body.com[0] == -0.05 == visitor.slider_value(COM)


def test_escape_an_empty_box_and_numbers_beyond_the_slider(visitor, applied):
    for text, end in (("0.3", "Escape"), ("", "Enter")):
        visitor.type_keys(FRICTION, text, end)
        visitor.tab.wait_for_timeout(300)
        assert applied == [] and visitor.slider_value(FRICTION) == LSR1.friction
    note_shown = visitor.record_note()
    visitor.type_keys(FRICTION, "99", "Enter")
    wait_until(lambda: applied == [2.0], "the end of the slider")
    wait_until(lambda: visitor.slider_value(FRICTION) == 2.0, "the box to show it")
    note = visitor.tab.locator("#limited")
    text, away = note_shown()  # it is at its box
    assert text == "limited to 2, the slider's largest value" and abs(away) < 20.0
    visitor.type_keys(FRICTION, "0.5", "Enter")
    wait_until(lambda: applied[-1] == 0.5, "a value within the range")
    note.wait_for(state="hidden")
    visitor.type_keys(FRICTION, "-1", "Enter")
    wait_until(lambda: applied[-1] == 0.16, "the smallest value")
    assert note.inner_text() == "limited to 0.16, the slider's smallest value"
    assert note.count() == 1


def test_a_dragged_slider_ends_at_its_last_value_and_the_path_is_judged_again(
    visitor, page, monkeypatch
):
    monkeypatch.setattr(page_module, "REPLAN_DELAY", WAIT)  # what is told of the path stays
    used = page.session.shown.verdict.max_friction_utilisation
    visitor.open_tab("Rover")
    visitor.drag_slider(FRICTION, 0.25)
    last = pytest.approx(0.62, abs=0.011)  # a quarter of 0.16 to 2
    wait_until(lambda: visitor.slider_value(FRICTION) == last, "the box to show it")
    shown = visitor.slider_value(FRICTION)
    wait_until(lambda: page.session.rover.friction == pytest.approx(shown), "the last value")
    visitor.wait_for("judged again in")
    now = page.session.shown.verdict.max_friction_utilisation
    assert now == pytest.approx(used * LSR1.friction / shown, rel=0.01)
    monkeypatch.undo()
    wait_for_rest(page)


def test_a_length_changes_the_figure_and_an_impossible_one_is_refused_with_the_reason(
    onlooker, page
):
    onlooker.open_tab("Rover")
    before = onlooker.picture()
    onlooker.set_slider(FRONT, "0.6")
    wait_until(lambda: page.session.rover.suspension.wheels["front"][0] == 0.6, "the wheel")
    wait_until(lambda: onlooker.picture() != before, "another figure")
    wait_for_rest(page)
    good = page.session.rover
    onlooker.shrink_scene()
    onlooker.set_slider("middle wheel x [m]", "0.6")
    onlooker.wait_for("refused: ")
    assert "suspension.wheels.front" in onlooker.text("#refusal")
    assert page.session.rover == good
    wait_until(lambda: onlooker.slider_value("middle wheel x [m]") == 0.0, "the last good value")


def test_a_changed_slider_is_marked_with_differences_and_can_be_undone_and_reset(visitor, page):
    visitor.open_tab("Rover")
    visitor.tab.wait_for_selector("#judging", state="hidden")
    place = visitor.place_of("speed [m/s]")
    for friction in (0.7, 0.6):
        visitor.set_slider(FRICTION, f"{friction}")
        wait_until(lambda f=friction: page.session.rover.friction == f, "the friction")
        wait_for_rest(page)
    visitor.wait_for(f"{CHANGED}{FRICTION}")
    assert "lsr1 (changed)" in visitor.text("#header")
    assert "firm, friction 0.6" in visitor.text("#header")
    wait_until(
        lambda: re.search(r"friction\s+0.8\s+0.6\s+-0.2", visitor.text("#changes")), "its change"
    )
    assert "friction, largest" in visitor.text("#changes")
    visitor.tab.wait_for_selector("#judging", state="hidden")
    assert visitor.place_of("speed [m/s]") == place  # a slider never moves under the mouse
    before = page.plots.curves["friction_utilisation"][1]
    assert (before[:, :6] != before[:, 6:]).any()
    visitor.press("Undo")
    wait_until(lambda: page.session.rover.friction == 0.7, "the rover before")
    wait_until(lambda: visitor.slider_value(FRICTION) == 0.7, "its slider")
    visitor.press("Reset")
    wait_until(lambda: page.session.rover == LSR1, "the loaded rover")
    wait_until(lambda: CHANGED not in visitor.text("body"), "no mark")


# Files and studies.


def test_a_rover_file_is_saved_and_loaded_and_presets_and_arm_follow(visitor, page, tmp_path):
    visitor.open_tab("Rover")
    box = visitor.row("Preset").locator("input").first
    wait_until(lambda: box.input_value() == "lsr1", "the preset")
    visitor.set_slider(FRICTION, "0.5")
    wait_until(lambda: page.session.rover.friction == 0.5, "the friction")
    wait_for_rest(page)
    with visitor.tab.expect_download() as download:
        visitor.press("Save as rover file")
    file = tmp_path / "rover.yaml"
    download.value.save_as(file)
    saved = read_rover(file.read_text(), "saved")
    assert saved == page.session.rover
    file.write_text(write_rover(replace(saved, name="bare", manipulator=None)))
    with visitor.tab.expect_file_chooser() as chooser:
        visitor.press("Load a rover file")
    chooser.value.set_files(file)
    wait_until(lambda: page.session.rover.name == "bare", "the loaded rover")
    wait_until(lambda: box.input_value() == "bare (file)", "the box of presets")
    nodes = page.server.scene._handle_from_node_name
    wait_until(lambda: "/rover/arm" not in nodes and "/rover/body" in nodes, "no arm")
    wait_until(lambda: "bare" in visitor.text("#header"), "the header")
    visitor.choose("Preset", "lsr1")
    wait_until(lambda: page.session.rover == LSR1, "the preset")
    wait_until(lambda: "/rover/arm" in nodes, "the arm")


def test_a_study_is_cancelled_and_another_one_gives_the_best_rover(visitor, page):
    visitor.open_tab("Studies")
    visitor.choose("Study", "tallest_step")
    visitor.wait_for("rovers like lsr1 for the largest")
    with held(page.studies.work):
        visitor.press("Run the study")
        visitor.wait_for("trying rover")
        visitor.press("Cancel the study")
        visitor.wait_for("cancelled")
        assert page.studies.work.progress is None
    visitor.choose("Study", "level_load_shares")
    visitor.wait_for("optimise at most 200 rovers")
    visitor.press("Run the study")
    visitor.wait_for("finished")
    visitor.wait_for("best:")
    visitor.tab.locator("#study-answer").wait_for()
    study = load_study(find_examples()["level_load_shares"])
    result = run_study(study)
    best = find_rover(study, result.best)
    assert best != page.session.rover
    visitor.press("Show the best rover")
    wait_until(lambda: page.session.rover == best, "the best rover")
    assert page.session.shown.scenario.loaded == study.rover
    wait_until(lambda: "lsr1 (changed)" in visitor.text("#header"), "the header")


# Judging in the background.


def test_while_a_change_is_judged_every_visitor_sees_so_and_the_old_verdict_is_grey(
    visitor, page, browser
):
    session = page.session
    before, shown = session.wanted, session.shown
    second = Visitor(browser, page.url, sees_scene=False)
    visitor.open_tab("Rover")
    with held(session._background):
        visitor.set_slider(FRICTION, "0.7")
        for one in (visitor, second):
            one.tab.wait_for_selector("#judging")
            one.wait_for("judging path")
            one.wait_for("old values: judging")
        assert session.wanted is not before and session.progress is not None
        assert session.shown is shown
        grey = set(range(len(session.shown.candidates)))
        wait_until(lambda: page.scene.paths._old == grey, "grey paths")
        ask(page, page.playback.play)
        wait_until(lambda: page.playback.time > 0.0, "the rover to drive on")
        ask(page, page.playback.pause)
    wait_for_rest(page)
    assert session.rover.friction == 0.7 and session.shown is not shown
    for one in (visitor, second):
        one.tab.wait_for_selector("#judging", state="hidden")
        one.tab.locator("#old").first.wait_for(state="detached")
    wait_until(lambda: page.scene.paths._old == set(), "coloured paths")
    assert second.page_errors == []
    second.tab.close()
    wait_until(lambda: len(page.server.get_clients()) < 2, "the visitor to be gone")


def test_a_cancelled_judgement_leaves_the_old_verdict_and_can_be_begun_again(visitor, page):
    session = page.session
    shown = session.shown
    visitor.open_tab("Rover")
    with held(session._background):
        visitor.set_slider(FRICTION, "0.6")
        visitor.press("Cancel")
        wait_until(lambda: session.is_stopped, "the end of the work")
    visitor.wait_for("Judge again")
    assert session.rover == LSR1 and session.shown is shown
    visitor.wait_for("old values: the judgement was stopped")
    assert visitor.slider_value(FRICTION) == session.wanted.rover.friction == 0.6
    visitor.press("Judge again")
    wait_for_rest(page)
    assert session.rover.friction == 0.6
    visitor.tab.locator("#old").first.wait_for(state="detached")


def test_a_visitor_of_a_page_that_ends_is_told(page, visitor):
    assert not visitor.tab.locator("#lost").is_visible()
    ask(page, lambda: page._load(lambda: load_rover("m2020")))
    wait_for_rest(page)
    page.close()  # this is the last test of the page
    visitor.wait_for("No connection to the program")
