"""The page in a real browser: why and where a path is refused, candidates, before and after."""

import re
from collections.abc import Iterator

import numpy as np
import pytest

from rover_planner.viewer.pages.page import Page
from rover_planner.viewer.panel.controls import CHANGED, FAILS
from rover_planner.viewer.scene.ribbons import BROAD_LINE_WIDTH, LINE_WIDTH
from rover_planner.viewer.state import colours
from rover_planner.viewer.state.reasons.explanation import explain
from rover_planner.viewer.state.session import ViewSession
from support.grounds import make_terrain, waves
from support.viewer.browser import OVERLAPS, Visitor, needs_browser, wait_until
from support.viewer.sessions import LSR1
from support.viewer.visits import find_camera, look_from, open_browser, wait_for_rest

pytestmark = [needs_browser, pytest.mark.slow]


def bumpy(x, y):
    """Return waves with a block on the straight path, which some candidates miss."""
    return waves(x, y) + 0.25 * ((abs(x - 0.5) < 0.2) & (abs(y) < 0.15))


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    served = Page(ViewSession(LSR1, make_terrain(bumpy), (-2, 0, 0), (2, 0, 0)), port=0)
    yield served
    served.close()


@pytest.fixture(scope="module")
def visitor(page) -> Iterator[Visitor]:
    with open_browser() as browser:
        yield Visitor(browser, page.url)


def show(page: Page, index: int) -> None:
    """Show a candidate and wait until it is judged."""
    asked: list[bool] = []
    page.requests.add(lambda: asked.append(page.session.show_candidate(index)))
    wait_until(lambda: asked, "the request")
    wait_until(lambda: page.session.shown.index == index and not page.is_busy, "the path")


def refused_index(page: Page) -> int:
    verdicts = [candidate.verdict for candidate in page.session.candidates]
    return next(k for k, verdict in enumerate(verdicts) if not verdict.traversable)


def test_a_refused_path_says_which_limit_by_how_much_where_and_a_button_goes_there(page, visitor):
    show(page, refused_index(page))
    failure = explain(page.session.finished).failure
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


def test_beside_the_sliders_a_long_reason_hides_no_policy(page, visitor, monkeypatch):
    show(page, refused_index(page))
    short = page.session.finished.reason
    text = f"no way within the map, closed in by much; the shown path: {short} {short} {short}"
    monkeypatch.setattr(type(page.session.finished), "reason", text)
    page.requests.add(page.judged.show_verdict)
    visitor.open_tab("Rover")
    wait_until(lambda: text in visitor.text("#verdict:visible"), "the reason")
    verdict = visitor.tab.locator("#verdict:visible")
    box = verdict.locator("xpath=..").bounding_box()
    policies = verdict.locator("#policies").bounding_box()
    assert policies["y"] > box["y"]
    assert policies["y"] + policies["height"] <= box["y"] + box["height"]
    monkeypatch.undo()
    page.requests.add(page.judged.show_verdict)
    visitor.open_tab("Drive")


def test_the_lanes_are_over_the_plots_with_the_same_scale(page, visitor):
    def ends_of(selector: str, k: int) -> np.ndarray:
        box = visitor.tab.locator(selector).nth(k).bounding_box()
        return np.array([box["x"], box["x"] + box["width"]])

    def differences() -> np.ndarray:
        lanes = ends_of("#lanes svg", 0)
        return np.abs([ends_of(".uplot .u-over", k) - lanes for k in range(3)])

    wait_until(lambda: differences().max() < 2.5, "the same scale")
    titles = visitor.text("#lanes")
    for lane in explain(page.session.finished).limits.lanes:
        assert lane.limit.title in titles


def test_the_letters_of_board_and_lanes_are_at_least_12_px_high(visitor):
    def measure() -> list[float]:
        return visitor.tab.evaluate(
            """() => [...document.querySelectorAll('#board text, #lanes div, #candidates td')].map(
                e => parseFloat(getComputedStyle(e).fontSize) *
                    (e.getCTM ? e.getScreenCTM().d : 1))"""
        )

    wait_until(lambda: len(measure()) > 30, "the letters")
    assert min(measure()) >= 11.95


@pytest.mark.parametrize(
    "camera",
    [
        ((0.0, 0.01, 12.0), "top"),
        ((-6.0, 0.02, 0.4), "flat, along the paths"),
        ((0.0, -9.0, 0.3), "side"),
        ((-60.0, -20.0, 2.0), "flat and far"),
    ],
    ids=lambda camera: camera[1],
)
def test_labels_do_not_overlap_on_the_screen(page, visitor, camera):
    show(page, refused_index(page))
    count = len(page.session.candidates) + 3  # start, goal and the failure
    look_from(page, visitor, camera[0], (0.0, 0.0, 0.2))
    wait_until(lambda: visitor.tab.evaluate(OVERLAPS) == [count, []], "labels that are apart")


def wait_for_highlight(page: Page, visitor: Visitor, index: int | None) -> None:
    """Wait until the browser of a visitor draws a path, or none, broad."""
    ribbons = page.scene.paths.ribbons
    wanted = [BROAD_LINE_WIDTH if k == index else LINE_WIDTH for k in ribbons]
    names = [ribbon._core.name for ribbon in ribbons.values()]
    wait_until(lambda: visitor.tab.evaluate(LINE_WIDTHS, names) == wanted, f"highlight of {index}")


LINE_WIDTHS = """names => names.map((name) => {
    const widths = [];
    const node = window.__viserMutable.nodeRefFromName[name];  // not while it is drawn anew
    if (node) node.traverse((part) => {
        if (part.material && part.material.linewidth > 1) widths.push(part.material.linewidth);
    });
    return widths[0];
})"""
"""Returns the widths of the lines of nodes of the scene [px]."""


def ground_of(visitor: Visitor, selector: str) -> str:
    return visitor.tab.locator(selector).evaluate("e => getComputedStyle(e).backgroundColor")


def test_what_one_visitor_points_at_is_highlighted_to_no_other(page, visitor):
    show(page, page.session.answer.nearest)
    other = Visitor(visitor.tab.context.browser, page.url)
    visitor.open_tab("Ground and path")
    other.open_tab("Ground and path")
    for one, row in ((visitor, 0), (other, 1)):
        one.tab.locator("#candidates tr[data-path]").nth(row).hover()
    wait_for_highlight(page, visitor, 0)
    wait_for_highlight(page, other, 1)
    page.requests.add(lambda: page.session.show_candidate(1))  # draws the paths again
    wait_until(lambda: page.session.shown.index == 1, "the other path")
    wait_for_rest(page)
    wait_for_highlight(page, visitor, 0)
    wait_for_highlight(page, other, 1)
    other.tab.close()
    wait_until(lambda: len(page.scene.paths._pointed) == 1, "the visitor to be forgotten")
    visitor.tab.mouse.move(600, 700)


def test_a_row_under_the_mouse_highlights_its_path_and_a_click_selects_it(page, visitor):
    show(page, refused_index(page))
    visitor.open_tab("Ground and path")
    rows = visitor.tab.locator("#candidates tr[data-path]")
    wait_until(lambda: rows.count() == len(page.session.candidates), "the table")
    wait_for_highlight(page, visitor, None)
    other = (page.session.answer.nearest + 1) % rows.count()
    drawn = [ribbon._core for ribbon in page.scene.paths.ribbons.values()]
    rows.nth(other).hover()
    wait_for_highlight(page, visitor, other)
    now = [ribbon._core for ribbon in page.scene.paths.ribbons.values()]
    assert all(one is other for one, other in zip(drawn, now, strict=True))  # drawn once
    assert "240, 228, 66" in ground_of(visitor, f'#candidates tbody[data-path="{other + 1}"]')
    assert "240, 228, 66" in ground_of(visitor, f'.label-box[data-path="{other + 1}"]')
    visitor.tab.mouse.move(600, 700)
    wait_for_highlight(page, visitor, None)
    best = page.session.answer.nearest
    rows.nth(best).click()
    wait_until(lambda: page.session.shown.index == best, "the best path")
    wait_until(lambda: rows.nth(best).get_attribute("aria-selected") == "true", "its mark")
    visitor.tab.mouse.move(600, 700)
    verdict = page.session.shown.verdict
    assert verdict.traversable
    text = rows.nth(best).inner_text()
    assert "passable, best" in text and f"{verdict.min_tip_over_ratio:.2f}" in text
    assert f"{verdict.max_friction_utilisation:.2f}" in text
    assert "refused" in visitor.text("#candidates")
    visitor.open_tab("Drive")
    wait_until(lambda: visitor.tab.locator("#failure").count() == 0, "the notice to go")
    mark = visitor.tab.get_by_text(FAILS, exact=True)
    wait_until(lambda: mark.count() == 0, "the old slider to go")
    visitor.set_slider("Time [s]", "3")
    wait_until(lambda: page.playback.time == 3.0, "the new slider to move the drive")


def focused_row(visitor: Visitor) -> int:
    """Return the number of the row that has the focus, 0 if none has."""
    return int(visitor.tab.evaluate("() => Number(document.activeElement.dataset.path || 0)"))


def test_rows_are_reached_and_selected_by_keys(page, visitor):
    show(page, page.session.answer.nearest)
    visitor.open_tab("Ground and path")
    rows = visitor.tab.locator("#candidates tr[data-path]")
    visitor.tab.get_by_role("tab", name="Share", exact=True).focus()
    keyboard = visitor.tab.keyboard
    keyboard.press("Tab")
    wait_for_highlight(page, visitor, 0)
    keyboard.press("ArrowDown")
    wait_for_highlight(page, visitor, 1)
    for key, index in (("Enter", 1), ("Space", 2)):
        keyboard.press(key)
        wait_until(lambda index=index: page.session.shown.index == index, key)
        wait_until(
            lambda index=index: rows.nth(index).get_attribute("aria-selected") == "true", "mark"
        )
        wait_until(lambda index=index: focused_row(visitor) == index + 1, "the focus to stay")
        keyboard.press("ArrowDown")
        wait_for_highlight(page, visitor, index + 1)
    assert page.playback.rate == 0.0  # space was the row's, not the drive's
    keyboard.press("Escape")
    visitor.tab.locator("#label-layer [data-path='1']").click()
    wait_until(lambda: page.session.shown.index == 0, "the path of the number")
    visitor.tab.mouse.move(600, 700)
    wait_for_highlight(page, visitor, None)


def test_a_changed_slider_is_marked_with_differences_and_can_be_undone_and_reset(page, visitor):
    show(page, page.session.answer.nearest)
    visitor.open_tab("Rover")
    visitor.tab.wait_for_selector("#judging", state="hidden")
    place = visitor.place_of("speed [m/s]")
    for friction in ("0.7", "0.6"):
        visitor.set_slider("friction [-]", friction)
        wait_until(lambda f=friction: page.session.rover.friction == float(f), "the friction")
        wait_for_rest(page)
    visitor.wait_for(f"{CHANGED}friction [-]")
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
    wait_until(lambda: visitor.slider_value("friction [-]") == 0.7, "its slider")
    visitor.press("Reset")
    wait_until(lambda: page.session.rover == LSR1, "the loaded rover")
    wait_until(lambda: CHANGED not in visitor.text("body"), "no mark")


def test_the_ground_shows_the_limit_on_its_scale_and_the_heading_of_the_path(page, visitor):
    visitor.open_tab("Ground and path")
    visitor.choose("Colour by", "friction utilisation")
    visitor.wait_for("beyond the limit of 1.00")
    assert visitor.tab.locator("#scale #limit").count() == 1
    visitor.press("Heading along the path")
    visitor.wait_for("friction utilisation along the path")
    visitor.choose("Colour by", "passable or not")
    visitor.wait_for("keeps all limits")
    assert visitor.page_errors == [] and page.errors.messages == {}
