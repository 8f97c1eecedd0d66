# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: why and where a path is refused, rows, labels, layers."""

import numpy as np
import pytest

from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.panel.controls import FAILS
from rover_planner.viewer.scene.ribbons import BROAD_LINE_WIDTH, LINE_WIDTH
from rover_planner.viewer.state import colours
from support.viewer.browser import OVERLAPS, Visitor, needs_browser, wait_until
from support.viewer.sessions import ask, wait_for_rest
from support.viewer.visits import find_camera, look_from, wait_for_browser

pytestmark = [needs_browser, pytest.mark.slow]

FAR_AND_FLAT = (-60.0, -20.0, 2.0), (0.0, 0.0, 0.2)
"""Place of a camera and where it looks [m]."""

LINE_WIDTHS = """names => names.map((name) => {
    const widths = [];
    const node = window.__viserMutable.nodeRefFromName[name];  // not while it is drawn anew
    if (node) node.traverse((part) => {
        if (part.material && part.material.linewidth > 1) widths.push(part.material.linewidth);
    });
    return widths[0];
})"""
"""Returns the widths of the lines of nodes of the scene [px]."""


def show(page: Page, index: int) -> None:
    """Show a candidate and wait until it is judged."""
    ask(page, lambda: page.session.show_candidate(index))
    wait_for_rest(page)
    assert page.session.shown.index == index


@pytest.fixture
def refused(visitor, page) -> None:
    """The first path that is refused is shown."""
    verdicts = [candidate.verdict for candidate in page.session.shown.candidates]
    show(page, next(k for k, verdict in enumerate(verdicts) if not verdict.traversable))


def test_a_refused_path_says_which_limit_by_how_much_where_and_a_button_goes_there(
    visitor, page, refused
):
    failure = page.judged.path.why.failure
    visitor.wait_for(failure.headline)
    place = f"after {failure.distance:.2f} m"
    wait_until(lambda: place in visitor.text("#failure"), "its place")
    mark = visitor.tab.get_by_text(FAILS, exact=True)
    wait_until(lambda: mark.count() == 1, "its mark")
    assert mark.evaluate("e => getComputedStyle(e).color") == f"rgb{colours.REFUSED}"
    visitor.press("Go to the failure")
    wait_until(lambda: abs(page.playback.time - failure.time) < 0.05, "the failure")
    wait_until(lambda: visitor.number("Distance") == pytest.approx(
        100.0 * failure.distance, abs=0.2), "the board to show it")  # fmt: skip
    assert visitor.tab.locator('#board [data-failing="true"]').count() == (failure.link != "")
    camera = find_camera(page)
    wait_until(
        lambda: np.allclose(camera.look_at, failure.state.position, atol=1e-3),
        "the camera to look there",
    )


def test_beside_the_sliders_a_long_reason_hides_no_policy(visitor, page, refused, monkeypatch):
    short = page.session.shown.reason
    text = f"no way within the map, closed in by much; the shown path: {short} {short} {short}"
    monkeypatch.setattr(type(page.session.shown), "reason", text)
    ask(page, page.judged.show_verdict)
    visitor.open_tab("Rover")
    wait_until(lambda: text in visitor.text("#verdict:visible"), "the reason")
    verdict = visitor.tab.locator("#verdict:visible")
    box = verdict.locator("xpath=..").bounding_box()
    policies = verdict.locator("#policies").bounding_box()
    assert policies["y"] > box["y"]
    assert policies["y"] + policies["height"] <= box["y"] + box["height"]


def test_lanes_have_the_scale_of_the_plots_and_no_letter_is_lower_than_12_px(
    visitor, page, refused
):
    def ends_of(selector: str, k: int) -> np.ndarray:
        # A lane that is drawn anew has no place for a moment: it is at none.
        nowhere = {"x": np.nan, "width": np.nan}
        box = visitor.tab.locator(selector).nth(k).bounding_box() or nowhere
        return np.array([box["x"], box["x"] + box["width"]])

    def differences() -> np.ndarray:
        lanes = ends_of("#lanes svg", 0)
        return np.abs([ends_of(".uplot .u-over", k) - lanes for k in range(3)])

    wait_until(lambda: differences().max() < 2.5, "the same scale")
    titles = visitor.text("#lanes")
    for lane in page.judged.path.why.limits.lanes:
        assert lane.limit.title in titles

    def measure() -> list[float]:
        return visitor.tab.evaluate(
            """() => [...document.querySelectorAll('#board text, #lanes div, #candidates td')].map(
                e => parseFloat(getComputedStyle(e).fontSize) *
                    (e.getCTM ? e.getScreenCTM().d : 1))"""
        )

    wait_until(lambda: len(measure()) > 30, "the letters")
    assert min(measure()) >= 11.95


def test_labels_do_not_overlap_on_the_screen(onlooker, page, refused):
    count = len(page.session.shown.candidates) + 3  # start, goal and the failure
    top, flat, at = (0.0, 0.01, 12.0), (-6.0, 0.02, 0.4), FAR_AND_FLAT[1]
    for place in (top, flat, (0.0, -9.0, 0.3), FAR_AND_FLAT[0]):
        look_from(page, onlooker, place, at)
        wait_until(lambda: onlooker.tab.evaluate(OVERLAPS) == [count, []], "labels that are apart")


# Rows of the table.


def wait_for_highlight(page: Page, visitor: Visitor, index: int | None) -> None:
    """Wait until the browser of a visitor draws a path, or none, broad."""
    ribbons = page.scene.paths.ribbons
    wanted = [BROAD_LINE_WIDTH if k == index else LINE_WIDTH for k in ribbons]
    names = [ribbon._core.name for ribbon in ribbons.values()]
    wait_until(lambda: visitor.tab.evaluate(LINE_WIDTHS, names) == wanted, f"highlight of {index}")


def test_a_row_under_the_mouse_highlights_its_path_to_this_visitor_and_a_click_selects_it(
    visitor, page, refused, browser
):
    def ground_of(selector: str) -> str:
        found = visitor.tab.locator(selector)
        return found.evaluate("e => getComputedStyle(e).backgroundColor")

    other = Visitor(browser, page.url, sees_scene=False)
    for one in (visitor, other):
        one.open_tab("Ground and path")
    rows = visitor.tab.locator("#candidates tr[data-path]")
    wait_until(lambda: rows.count() == len(page.session.shown.candidates), "the table")
    wait_for_highlight(page, visitor, None)
    best = page.session.shown.answer.nearest
    pointed = (best + 1) % rows.count()
    drawn = [ribbon._core for ribbon in page.scene.paths.ribbons.values()]
    rows.nth(pointed).hover()
    other.tab.locator("#candidates tr[data-path]").nth(best).hover()
    wait_for_highlight(page, visitor, pointed)
    wait_for_highlight(page, other, best)
    now = [ribbon._core for ribbon in page.scene.paths.ribbons.values()]
    assert all(one is same for one, same in zip(drawn, now, strict=True))  # drawn once
    assert "240, 228, 66" in ground_of(f'#candidates tbody[data-path="{pointed + 1}"]')
    assert "240, 228, 66" in ground_of(f'.label-box[data-path="{pointed + 1}"]')
    show(page, pointed)  # draws the paths again
    wait_for_highlight(page, visitor, pointed)
    wait_for_highlight(page, other, best)
    other.tab.close()
    wait_until(lambda: len(page.scene.paths._pointed) == 1, "the visitor to be forgotten")
    rows.nth(best).click()
    wait_until(lambda: page.session.shown.index == best, "the best path")
    wait_until(lambda: rows.nth(best).get_attribute("aria-selected") == "true", "its mark")
    visitor.tab.mouse.move(600, 700)
    wait_for_highlight(page, visitor, None)
    assert "passable, best" in rows.nth(best).inner_text()
    visitor.open_tab("Drive")
    wait_until(lambda: visitor.tab.locator("#failure").count() == 0, "the notice to go")
    mark = visitor.tab.get_by_text(FAILS, exact=True)
    wait_until(lambda: mark.count() == 0, "the old slider to go")
    visitor.set_slider("Time [s]", "3")
    wait_until(lambda: page.playback.time == 3.0, "the new slider to move the drive")


def test_rows_and_labels_are_reached_and_selected_by_keys_and_clicks(onlooker, page):
    onlooker.open_tab("Ground and path")
    rows = onlooker.tab.locator("#candidates tr[data-path]")
    onlooker.tab.get_by_role("tab", name="Share", exact=True).focus()
    keyboard = onlooker.tab.keyboard
    keyboard.press("Tab")
    wait_for_highlight(page, onlooker, 0)
    keyboard.press("ArrowDown")
    wait_for_highlight(page, onlooker, 1)
    focused = "() => Number(document.activeElement.dataset.path || 0)"
    for key, index in (("Enter", 1), ("Space", 2)):
        keyboard.press(key)
        wait_until(lambda index=index: page.session.shown.index == index, key)
        wait_until(
            lambda index=index: rows.nth(index).get_attribute("aria-selected") == "true", "mark"
        )
        wait_until(lambda index=index: onlooker.tab.evaluate(focused) == index + 1, "the focus")
        keyboard.press("ArrowDown")
        wait_for_highlight(page, onlooker, index + 1)
    assert page.playback.rate == 0.0  # space was the row's, not the drive's
    keyboard.press("Escape")
    wait_for_rest(page)
    look_from(page, onlooker, *FAR_AND_FLAT)  # the label is in front of the sky
    wait_for_browser(page, onlooker)  # a label that is made anew loses a click
    onlooker.tab.locator("#label-layer [data-path='1']").click()
    wait_until(lambda: page.session.shown.index == 0, "the path of the number")
    onlooker.tab.mouse.move(600, 700)
    wait_for_highlight(page, onlooker, None)


# The ground.


def test_a_layer_colours_the_ground_with_its_limit_on_the_scale_and_a_soil_lets_wheels_sink(
    onlooker, page
):
    onlooker.open_tab("Ground and path")
    before = onlooker.picture()
    assert not onlooker.tab.get_by_text("Heading [deg]").is_visible()
    onlooker.choose("Colour by", "tilt")
    onlooker.wait_for("29.79 deg")
    onlooker.tab.get_by_text("Heading [deg]").wait_for()
    wait_until(lambda: onlooker.picture() != before, "other colours")
    onlooker.shrink_scene()
    onlooker.choose("Colour by", "friction utilisation")
    onlooker.wait_for("beyond the limit of 1.00")
    assert onlooker.tab.locator("#scale #limit").count() == 1
    onlooker.press("Heading along the path")
    onlooker.wait_for("friction utilisation along the path")
    onlooker.choose("Colour by", "passable or not")
    onlooker.wait_for("keeps all limits")
    onlooker.choose("Colour by", "height")
    assert page.session.shown.verdict.max_sinkage == 0.0
    onlooker.choose("Soil", "dry_sand")
    wait_until(lambda: page.session.shown.verdict.max_sinkage > 0.0, "wheels that sink")
    onlooker.choose("Soil", "none (Coulomb)")
    wait_until(lambda: page.session.scenario.options.model.soil is None, "hard ground")
