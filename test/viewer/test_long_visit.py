# SPDX-License-Identifier: Apache-2.0
"""A visit of ten minutes to the program itself, on three grounds, as a demanding person clicks."""

import time
from contextlib import suppress

import pytest

from benchmarks.bench_page import AT_REST, MOST_MEMORY, open_view
from benchmarks.grounds import made_reef
from benchmarks.processes import memory_of
from rover_physics.terrain.grid import save_terrain
from support.viewer.browser import Visitor, needs_browser, open_browser, sync_api
from support.viewer.sessions import wait_patiently as wait_until

pytestmark = [needs_browser, pytest.mark.long]

MINUTES, ROUNDS = 10.0, 4
"""Time of all visits, and the least number of rounds of each: in the first, memory grows."""
STEADY = 1.02
"""Least memory in the last third of a visit over the most in the rounds after the first and up to
the second third: it goes up and down."""
FRICTION = "friction [-]"


def wait_for_rest(visitor: Visitor) -> None:
    """Wait until nothing is judged and nothing is old."""
    visitor.tab.wait_for_timeout(300)
    wait_until(lambda: visitor.tab.evaluate(AT_REST), "all paths to be judged")


def change(visitor: Visitor, values: dict[str, str]) -> None:
    """Type values beside sliders by their labels, one soon after another."""
    visitor.open_tab("Rover")
    for closed in visitor.tab.locator("#sliders details:not([open]) summary").all()[::-1]:
        closed.click()
    for label, value in values.items():
        visitor.type_number(label, value)


def take_advice(visitor: Visitor) -> None:
    """Wait for what is found by the time that the page promises, look at it, and stop."""
    tab, remedies = visitor.tab, visitor.tab.locator("#advice li[tabindex]")
    visitor.press("What would help?")
    stop = tab.locator("#advice").get_by_role("button", name="Stop")
    found = "the search goes on"
    wait_until(lambda: remedies.count() or found in visitor.text("#advice"), "the advice")
    if remedies.count():
        remedies.first.hover()
    if stop.count():
        with suppress(sync_api.TimeoutError):  # it may end before it is clicked
            stop.click(timeout=5000.0)
    wait_until(lambda: not stop.count(), "the end of the search")


def click_through(visitor: Visitor) -> None:
    """Do once what the page is for, and hold the path that it shows against what it must."""
    tab = visitor.tab
    visitor.open_tab("Paths")
    rows = tab.locator("#paths tr[tabindex]").all_inner_texts()
    row = next((k for k, words in enumerate(rows) if "refused" in words), 0)
    tab.locator("#paths tr[tabindex]").nth(row).click()
    wait_until(lambda: f"path {row + 1} of" in visitor.text("#verdict"), "the path")
    wait_for_rest(visitor)
    change(visitor, {FRICTION: "0.85"})
    wait_for_rest(visitor)
    assert f"path {row + 1} of" in visitor.text("#verdict")  # whatever its verdict is now
    visitor.press("Keep as reference")
    change(visitor, {FRICTION: "0.3"})
    wait_for_rest(visitor)
    assert f"path {row + 1} of" in visitor.text("#verdict")
    visitor.press("Compare with loaded")
    # The second value is refused.
    change(visitor, {"wheels z [m]": "-0.15", "radius [m]": "0.02"})
    wait_for_rest(visitor)
    visitor.press("Reset")
    wait_until(lambda: "(changed)" not in visitor.text("#subject"), "the loaded rover")
    wait_for_rest(visitor)
    if tab.get_by_role("button", name="Go to the failure").count():
        visitor.press("Go to the failure")
        take_advice(visitor)
    visitor.press("To the start")
    visitor.press("Play")
    tab.wait_for_timeout(2000)
    if tab.get_by_role("button", name="Pause").count():  # a path that fails at once is over
        visitor.press("Pause")
    visitor.open_tab("Ground")
    for layer in ("use of all limits", "slope", "height"):
        visitor.choose("Colour by", layer)
        wait_until(lambda layer=layer: layer in visitor.text("#legend"), layer)
    assert visitor.text("#errors") == "" and visitor.page_errors == []


@pytest.mark.parametrize("ground", ["made", "spirit", "reef"])
def test_a_long_visit_keeps_path_comparison_and_memory(ground, tmp_path):
    arguments = ["lsr1", *([] if ground == "made" else [ground])]
    if ground == "reef":
        save_terrain(tmp_path / "reef.npz", made_reef())
        arguments = ["lsr1", str(tmp_path / "reef.npz")]
    with open_browser() as browser:
        with open_view(*arguments) as (process, url):
            visitor = Visitor(browser, url)
            begin, memory = time.monotonic(), []
            while time.monotonic() - begin < 20.0 * MINUTES or len(memory) < ROUNDS:
                click_through(visitor)
                memory.append(memory_of(process))
            change(visitor, {FRICTION: "0.7"})
            wait_until(lambda: "friction 0.7" in visitor.text("#subject"), "the new verdict")
            wait_for_rest(visitor)
        print(ground, [round(one) for one in memory])
        assert max(memory) < MOST_MEMORY, memory
        third = len(memory) // 3
        assert min(memory[-third:]) < STEADY * max(memory[1 : third + 2]), memory
        visitor.wait_for("No connection to the program")
        with open_view(*arguments, port=int(url.rsplit(":", 1)[1])):
            visitor.wait_for("The program was started again; what you had changed is taken up.")
            wait_until(lambda: "friction 0.7" in visitor.text("#subject"), "the changed rover")
