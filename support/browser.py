"""A real browser for tests: which one there is, how it is started, and what a visitor does."""

import re
import shutil
import time
from collections.abc import Callable
from typing import Any

import pytest

viser = pytest.importorskip("viser", reason="no viser: pip install '.[view]'")
sync_api = pytest.importorskip(
    "playwright.sync_api", reason="no playwright: pip install '.[test]'"
)

NAMES = ("chromium", "chromium-browser", "google-chrome")
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
"""Draws WebGL without a graphics card, and asks nothing of the network."""
LAPTOP = {"width": 1280, "height": 720}
WAIT = 120.0
"""Longest wait for anything on the page [s]: a busy machine draws a picture in seconds."""

needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason=f"no browser installed: none of {', '.join(NAMES)} is on the path"
)


def wait_until(condition: Callable[[], Any], what: str) -> Any:
    """Return the condition's first true value; fail with what was waited for."""
    end = time.monotonic() + WAIT
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    raise AssertionError(f"waited {WAIT} s for {what}")


class Visitor:
    """A person before the page: sees texts and pixels, presses, drags and clicks."""

    def __init__(self, browser: Any, url: str):
        # Few pixels: without a graphics card each one costs time.
        self.tab = browser.new_page(viewport=LAPTOP, device_scale_factor=0.4)
        self.faults: list[str] = []
        self.tab.on("pageerror", lambda error: self.faults.append(str(error)))
        self.tab.set_default_timeout(1000.0 * WAIT)
        self.tab.goto(url)
        self.tab.wait_for_selector("#board")

    def open_tab(self, name: str) -> None:
        """Open a tab of the panel."""
        self.tab.get_by_role("tab", name=name, exact=True).click()

    def press(self, name: str) -> None:
        """Press a button."""
        self.tab.get_by_role("button", name=name, exact=True).or_(
            self.tab.get_by_text(name, exact=True)
        ).first.click()

    def _row(self, label: str) -> Any:
        named = self.tab.get_by_text(label, exact=True)
        return named.locator("xpath=ancestor::*[.//input][1]")

    def set_slider(self, label: str, value: str) -> None:
        """Type a value into the box beside a slider, key by key.

        Not `fill`, which puts a text there without a key: the box then takes it for a change at
        the place where the last key was pressed, and may throw it away.
        """
        box = self._row(label).locator("input").last
        box.click()
        box.press("Control+a")
        box.press_sequentially(value)
        box.press("Enter")

    def slider_value(self, label: str) -> float:
        """Return what the box beside a slider shows."""
        return float(self._row(label).locator("input").last.input_value())

    def drag_slider(self, label: str, share: float) -> None:
        """Drag the thumb of a slider to a share of its range, over many values."""
        thumb = self._row(label).get_by_role("slider")
        track = thumb.locator("xpath=..").bounding_box()
        at = thumb.bounding_box()
        y = at["y"] + at["height"] / 2
        self.tab.mouse.move(at["x"] + at["width"] / 2, y)
        self.tab.mouse.down()
        self.tab.mouse.move(track["x"] + share * track["width"], y, steps=25)
        self.tab.mouse.up()

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a drop-down."""
        self._row(label).locator("input:visible").first.click()
        self.tab.get_by_role("option", name=option, exact=True).click()

    def text(self, selector: str) -> str:
        """Return the text of an element of the page."""
        return self.tab.inner_text(selector)

    def wait_for(self, text: str) -> None:
        """Wait until a text is on the page."""
        self.tab.wait_for_function("text => document.body.innerText.includes(text)", arg=text)

    def number(self, name: str) -> float:
        """Return a number of the board, such as "Time"."""
        found = re.search(rf"{name}\s+(-?[\d.]+)", self.text("#board"))
        assert found, f"no {name} on the board: {self.text('#board')}"
        return float(found.group(1))

    def picture(self) -> bytes:
        """Return the pixels of the scene."""
        return self.tab.locator("canvas").first.screenshot()

    def click_scene(self, x: float, y: float, *, shift: bool = False) -> None:
        """Click at a place of the screen [px]."""
        if shift:
            self.tab.keyboard.down("Shift")
        self.tab.mouse.click(x, y)
        if shift:
            self.tab.keyboard.up("Shift")
