# SPDX-License-Identifier: Apache-2.0
"""A real browser for tests: finds and starts it, and operates the page as a user does."""

import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

CHANGED = ""
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
SCALE = 0.1
"""Pixels of the screen for each of the page: without a graphics card rendering is slow."""

needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason=f"no browser installed: none of {', '.join(NAMES)} is on the path"
)


def wait_until(condition: Callable[[], Any], what: str) -> Any:
    """Return the condition's first true value; fail with `what` after WAIT."""
    return waiting.wait_until(condition, what, WAIT)


@contextmanager
def open_browser() -> Iterator[Any]:
    """Start a browser."""
    with sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=PROGRAM, args=ARGUMENTS, timeout=1000.0 * WAIT
        )
        yield chromium
        chromium.close()


class Visitor:
    """A simulated user of the page: reads texts, presses, drags and clicks."""

    def __init__(self, browser: Any, url: str, scale: float = SCALE):
        """Open the page."""
        self.tab = browser.new_page(viewport=LAPTOP, device_scale_factor=scale)
        self.page_errors: list[str] = []
        self.tab.on("pageerror", lambda error: self.page_errors.append(str(error)))
        self.tab.set_default_timeout(1000.0 * WAIT)
        self.tab.goto(url)
        self.tab.wait_for_selector("#dashboard")

    def open_tab(self, name: str) -> None:
        """Open a tab of the panel."""
        self.tab.get_by_role("tab", name=name, exact=True).click()

    def press(self, name: str) -> None:
        """Press a button."""
        self.tab.get_by_role("button", name=name, exact=True).or_(
            self.tab.get_by_text(name, exact=True)
        ).first.click()

    def row(self, label: str) -> Any:
        """Return the row of the panel with a label, whether it is marked as changed or not."""
        named = self.tab.get_by_text(label, exact=True).or_(
            self.tab.get_by_text(f"{CHANGED}{label}", exact=True)
        )
        return named.locator("xpath=ancestor::*[.//input][1]")

    def type_number(self, label: str, value: str) -> None:
        """Type a value into the box beside a slider, key by key, and leave the box."""
        box = self.row(label).locator("input").last
        box.click()
        keyboard = self.tab.keyboard
        keyboard.press("Control+a")
        keyboard.type(value)
        keyboard.press("Tab")

    def slider_value(self, label: str) -> float:
        """Return the value in the box beside a slider."""
        return float(self.row(label).locator("input").last.input_value())

    def drag_slider(self, label: str, share: float, moves: int = 10) -> None:
        """Drag the thumb of a slider to a share of its range, in a number of moves."""
        thumb = self.row(label).get_by_role("slider")
        thumb.scroll_into_view_if_needed()
        at, track = thumb.bounding_box(), thumb.locator("xpath=..").bounding_box()
        x, y = at["x"] + 0.5 * at["width"], at["y"] + 0.5 * at["height"]
        self.tab.mouse.move(x, y)
        self.tab.mouse.down()
        self.tab.mouse.move(track["x"] + share * track["width"], y, steps=moves)
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
        return str(self.tab.inner_text(selector))

    def wait_for(self, text: str) -> None:
        """Wait until the page shows a text."""
        self.tab.wait_for_function("text => document.body.innerText.includes(text)", arg=text)

    def number(self, name: str) -> float:
        """Return a number of the dashboard, such as "Time"."""
        found = re.search(rf"{name}\s+(-?[\d.]+)", self.text("#dashboard"))
        assert found, f"no {name} on the dashboard: {self.text('#dashboard')}"
        return float(found.group(1))

    def click_share(self, selector: str, share: float) -> None:
        """Click at a share of the width of an element, in the middle of its height."""
        box = self.tab.locator(selector).first.bounding_box()
        self.tab.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
