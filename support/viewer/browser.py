# SPDX-License-Identifier: Apache-2.0
"""A real browser for tests: finds and starts it, and operates the page as a user does."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from support.viewer.sessions import PATIENCE as WAIT

viser = pytest.importorskip("viser", reason="no viser: pip install '.[view]'")
sync_api = pytest.importorskip(
    "playwright.sync_api", reason="no playwright: pip install '.[test]'"
)

NAMES = ("chromium", "chromium-browser", "google-chrome")
"""Programs that are tried, in this order."""
PROGRAM = next(filter(None, map(shutil.which, NAMES)), None)
ARGUMENTS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""Options of the browser: WebGL without a graphics card."""
LAPTOP = {"width": 1280, "height": 720}
"""Size of a laptop's window [px]."""
SCALE = 0.1
"""Pixels of the screen for each of the page: without a graphics card rendering is slow."""
SCALE_SCENE = """
if (window !== window.top && location.protocol === "http:") {{
  history.replaceState(null, "", "?fixedDpr={scale}");
}}
"""
"""JavaScript that has the scene, a page within the page, scaled like the page: else it is not."""
MEASURE = "selector => document.querySelector(selector)?.getBoundingClientRect()?.toJSON()"
"""JavaScript that finds and measures an element at one moment."""
READ_LETTERS = Path(__file__).with_name("read_letters.js").read_text(encoding="utf-8")
"""JavaScript that returns text, size [px] and contrast of all letters that are shown."""

needs_browser = pytest.mark.skipif(
    PROGRAM is None, reason=f"no browser installed: none of {', '.join(NAMES)} is on the path"
)


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
        self.tab.add_init_script(SCALE_SCENE.format(scale=scale))
        self.tab.on("pageerror", lambda error: self.page_errors.append(str(error)))
        self.tab.set_default_timeout(1000.0 * WAIT)
        self.tab.goto(url)
        self.tab.wait_for_selector("#board .wheel")

    def open_tab(self, name: str) -> None:
        """Open a tab of the panel."""
        self.tab.get_by_role("tab", name=name, exact=True).click()

    def press(self, name: str) -> None:
        """Press a button."""
        self.tab.get_by_role("button", name=name, exact=True).click()

    def box(self, label: str) -> Any:
        """Return the box of a number beside its slider."""
        return self.tab.get_by_role("spinbutton", name=label, exact=True)

    def type_number(self, label: str, value: str) -> None:
        """Type a value into the box beside a slider, and leave the box."""
        self.box(label).fill(value)
        self.tab.keyboard.press("Tab")

    def choose(self, label: str, option: str) -> None:
        """Choose an option of a drop-down."""
        self.tab.get_by_label(label, exact=True).select_option(option)

    def text(self, selector: str) -> str:
        """Return the text of an element of the page."""
        return str(self.tab.inner_text(selector))

    def is_on_screen(self, selector: str) -> bool:
        """Return whether all of an element is within the window."""
        box = self._measure(selector)
        below, beside = box["y"] + box["height"], box["x"] + box["width"]
        return box["y"] >= 0.0 and below <= LAPTOP["height"] and beside <= LAPTOP["width"]

    def wait_for(self, text: str) -> None:
        """Wait until the page shows a text."""
        self.tab.wait_for_function("text => document.body.innerText.includes(text)", arg=text)

    def click_share(self, selector: str, share: float) -> None:
        """Click at a share of the width of an element, in the middle of its height."""
        box = self._measure(selector)
        self.tab.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])

    def _measure(self, selector: str) -> dict[str, float]:
        """Return place and size of an element [px], which may be drawn anew at any moment."""
        found = self.tab.wait_for_function(MEASURE, arg=selector).json_value()
        return {name: float(found[name]) for name in ("x", "y", "width", "height")}
