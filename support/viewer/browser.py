# SPDX-License-Identifier: Apache-2.0
"""A real browser for tests: finds and starts it, and operates the page as a user does."""

import re
import shutil
from collections.abc import Callable
from typing import Any

import pytest

from rover_planner.viewer.panel.controls import CHANGED
from support import waiting

viser = pytest.importorskip("viser", reason="no viser: pip install '.[view]'")
sync_api = pytest.importorskip(
    "playwright.sync_api", reason="no playwright: pip install '.[test]'"
)

NAMES = ("chromium", "chromium-browser", "google-chrome")
"""Programs that are tried, in this order."""
PROGRAM = next(filter(None, map(shutil.which, NAMES)), None)
ARGUMENTS = [
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--no-sandbox",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
"""Options of the browser: WebGL without a graphics card, and no network requests."""
LAPTOP = {"width": 1280, "height": 720}
"""Size of a laptop's window [px]."""
WAIT = 120.0
"""Longest wait for the page [s]; rendering takes seconds on a busy machine."""

RECORD = """text => {
    window.shownTexts = window.shownTexts || {};
    window.shownTexts[text] = false;
    new MutationObserver(() => {
        window.shownTexts[text] ||= document.body.innerText.includes(text);
    }).observe(document.body, {
        attributes: true, characterData: true, childList: true, subtree: true
    });
}"""
"""Notes in the page when a text has appeared."""

RECORD_NOTE = """() => {
    const note = document.getElementById('limited');
    new MutationObserver(() => {
        if (note.style.display !== 'block' || window.shownNote) return;
        const box = document.activeElement.getBoundingClientRect();
        window.shownNote = [note.textContent, note.getBoundingClientRect().top - box.bottom];
    }).observe(note, { attributes: true });
}"""
"""Keeps what the note at a box says, and how far it is below the box [px]."""

SHRINK = """() => {
    if (document.getElementById('small-scene')) return;
    const style = document.createElement('style');
    style.id = 'small-scene';
    style.textContent = 'div[style*="touch-action: none"] > div '
        + '{width: 16px !important; height: 16px !important}';
    document.head.append(style);
}"""
"""Lets the browser draw a scene of 16 x 16 pixels."""

OVERLAPS = """() => {
    const boxes = [...document.querySelectorAll('.label-box')].filter(e => e.offsetParent).map(
        e => [e.textContent, e.getBoundingClientRect()]);
    const meet = (p, q) => p.left < q.right && q.left < p.right
        && p.top < q.bottom && q.top < p.bottom;
    return [boxes.length, boxes.flatMap(([name, p], k) => boxes.slice(0, k)
        .filter(([, q]) => meet(p, q)).map(([other]) => [name, other]))];
}"""
"""How many labels are seen, and which of them overlap."""

FIND_THUMB = """thumb => {
    thumb.scrollIntoViewIfNeeded();
    const at = thumb.getBoundingClientRect(), track = thumb.parentElement.getBoundingClientRect();
    return [at.x + at.width / 2, at.y + at.height / 2, track.x, track.width];
}"""
"""Scrolls to the thumb of a slider; returns where it is, and left edge and width of its track."""

HAS_GROUND = """() => {
    const ground = window.__viserMutable && window.__viserMutable.nodeRefFromName['/ground'];
    let meshes = 0;
    if (ground) ground.traverse((part) => { meshes += part.isMesh ? 1 : 0; });
    return meshes > 0;
}"""
"""Whether the ground is in the scene."""

needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason=f"no browser installed: none of {', '.join(NAMES)} is on the path"
)


def wait_until(condition: Callable[[], Any], what: str) -> Any:
    """Return the condition's first true value; fail with `what` after WAIT."""
    return waiting.wait_until(condition, what, WAIT)


class Visitor:
    """A simulated user of the page: reads texts and pixels, presses, drags and clicks."""

    def __init__(self, browser: Any, url: str, scale: float = 0.4, sees_scene: bool = True):
        # Few pixels by default, because rendering without a graphics card is slow.
        self.tab = browser.new_page(viewport=LAPTOP, device_scale_factor=scale)
        self.page_errors: list[str] = []
        self.tab.on("pageerror", lambda error: self.page_errors.append(str(error)))
        self.tab.set_default_timeout(1000.0 * WAIT)
        if not sees_scene:
            self.tab.add_init_script(f"document.addEventListener('DOMContentLoaded', {SHRINK})")
        self.tab.goto(url)
        self.tab.wait_for_selector("#dashboard")

    def shrink_scene(self) -> None:
        """Let the browser draw few pixels of the scene, for a test that does not look at it.

        Without a graphics card it then draws 60 times as many pictures.
        """
        self.tab.evaluate(SHRINK)

    def show_scene(self) -> None:
        """Let the browser draw the whole scene again."""
        self.tab.evaluate("() => document.getElementById('small-scene')?.remove()")

    def hide_notices(self) -> None:
        """Hide the notices of viser, which may cover what is clicked or seen."""
        self.tab.add_style_tag(content=".mantine-Notifications-root { display: none; }")

    def open_tab(self, name: str) -> None:
        """Open a tab of the panel."""
        self.tab.get_by_role("tab", name=name, exact=True).click()

    def press(self, name: str) -> None:
        """Press a button."""
        self.tab.get_by_role("button", name=name, exact=True).or_(
            self.tab.get_by_text(name, exact=True)
        ).first.click()

    def buttons(self, label: str) -> Callable[[], list[str]]:
        """Return what lists the names of the buttons in a row."""
        named = self.tab.get_by_text(label, exact=True)
        row = named.locator("xpath=ancestor::*[.//button][1]")
        return lambda: row.get_by_role("button").all_inner_texts()

    def row(self, label: str) -> Any:
        """Return the row of the panel with a label."""
        named = self.tab.get_by_text(label, exact=True).or_(
            self.tab.get_by_text(f"{CHANGED}{label}", exact=True)
        )
        return named.locator("xpath=ancestor::*[.//input][1]")

    def set_slider(self, label: str, value: str) -> None:
        """Type a value into the box beside a slider, key by key.

        Playwright's `fill` sets the text without key events. The box may then discard the text.
        """
        box = self.row(label).locator("input").last
        box.click()
        box.press("Control+a")
        box.press_sequentially(value)
        box.press("Enter")

    def type_keys(self, label: str, text: str, end: str = "") -> None:
        """Type into the box beside a slider, slowly and key by key, and press a last key."""
        box = self.row(label).locator("input").last
        box.click()
        box.press("Control+a")
        box.press_sequentially(text, delay=30)
        if end:
            box.press(end)

    def place_of(self, label: str) -> float:
        """Return the height of a slider below the upper edge of the window [px]."""
        return float(self.row(label).bounding_box()["y"])

    def slider_value(self, label: str) -> float:
        """Return the value in the box beside a slider."""
        return float(self.row(label).locator("input").last.input_value())

    def drag_slider(self, label: str, share: float, moves: int = 25) -> None:
        """Drag the thumb of a slider to a share of its range, in a number of moves."""
        thumb = self.row(label).get_by_role("slider")
        x, y, left, width = thumb.evaluate(FIND_THUMB)
        self.tab.mouse.move(x, y)
        self.tab.mouse.down()
        self.tab.mouse.move(left + share * width, y, steps=moves)
        self.tab.mouse.up()

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a drop-down, which a page that redraws its panel may close again."""

        def is_chosen() -> bool:
            self.row(label).locator("input:visible").first.click()
            wanted = self.tab.get_by_role("option", name=option, exact=True)
            try:
                wanted.click(timeout=5000)
            except Exception:  # playwright's TimeoutError; playwright is imported late
                self.tab.keyboard.press("Escape")
                return False
            return True

        wait_until(is_chosen, f"the option {option}")

    def text(self, selector: str) -> str:
        """Return the text of an element of the page."""
        return self.tab.inner_text(selector)

    def record(self, text: str) -> Callable[[], bool]:
        """Record from now on whether the page shows a text; return what tells it later.

        A text that comes and goes may be gone when a test looks for it on a busy machine.
        """
        self.tab.evaluate(RECORD, text)
        return lambda: bool(self.tab.evaluate("text => window.shownTexts[text]", text))

    def record_note(self) -> Callable[[], tuple[str, float]]:
        """Record the first note at a box from now on; return what tells it and how far it is.

        It stays for 6 s only.
        """
        self.tab.evaluate(RECORD_NOTE)
        return lambda: self.tab.evaluate("() => window.shownNote")

    def wait_for(self, text: str) -> None:
        """Wait until the page shows a text."""
        self.tab.wait_for_function("text => document.body.innerText.includes(text)", arg=text)

    def number(self, name: str) -> float:
        """Return a number of the dashboard, such as "Time"."""
        found = re.search(rf"{name}\s+(-?[\d.]+)", self.text("#dashboard"))
        assert found, f"no {name} on the dashboard: {self.text('#dashboard')}"
        return float(found.group(1))

    def picture(self) -> bytes:
        """Return the pixels of the scene."""
        return self.tab.locator("canvas").first.screenshot()

    def wait_for_ground(self) -> None:
        """Wait until the ground is in the scene, where it can be clicked and seen."""
        self.tab.wait_for_function(HAS_GROUND)

    def steady_picture(self) -> bytes:
        """Return the pixels of the scene once they do not change any more."""
        pictures = [self.picture()]

        def is_steady() -> bool:
            self.tab.wait_for_timeout(300)
            pictures.append(self.picture())
            return len(pictures) > 2 and pictures[-1] == pictures[-2] == pictures[-3]

        wait_until(is_steady, "a picture that does not change")
        return pictures[-1]

    def click_scene(self, x: float, y: float, *, shift: bool = False) -> None:
        """Click at a point of the screen [px]."""
        if shift:
            self.tab.keyboard.down("Shift")
        self.tab.mouse.click(x, y)
        if shift:
            self.tab.keyboard.up("Shift")
