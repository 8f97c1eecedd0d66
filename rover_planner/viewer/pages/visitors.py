"""What a visitor's browser needs when it connects: its link, and panels that fit in."""

from collections.abc import Callable
from typing import Any

from rover_planner.viewer.browser.channel import FLOAT_GAP, ask_browser, dock_left, float_below
from rover_planner.viewer.panel.header import FLOATING, NARROW, SHEET

QUESTION = "[location.search, window.innerWidth]"
PANEL_WIDTH, PLOTS_WIDTH = 394, 300
"""Widths of the panels on the right and on the left [px]; a laptop's screen shows the scene."""


class Visitors:
    """Greets each visitor, and places the panels in narrow windows.

    There the plots float over the lower edge of the scene: below the main panel they would take
    half of its height from the board.
    """

    def __init__(self, panel: Any, open_link: Callable[[str], None]):
        """Greet nobody yet.

        Args:
            panel: The panel on the left, which floats over the scene in narrow windows.
            open_link: Called with the query of the address of each visitor.
        """
        self._panel, self._open_link = panel, open_link
        self._floats: dict[int, float] = {}
        """Widths of the floating panel of visitors with narrow windows [px]."""
        self._sizes: dict[int, tuple[int, int]] = {}

    def greet(self, client: Any) -> None:
        """Read a new visitor's address and fit the panels; it waits for the browser."""
        answer = ask_browser(client, QUESTION)
        if answer is None:
            return
        query, width = answer
        self._fit(client, width)
        if query:
            self._open_link(query)
        client.camera.on_update(lambda _camera: self._resize(client))

    def forget(self, client: Any) -> None:
        """Forget a visitor who has left."""
        self._floats.pop(client.client_id, None)
        self._sizes.pop(client.client_id, None)

    def _resize(self, client: Any) -> None:
        """Fit the panels again if the size of the picture has changed."""
        size = client.camera.image_width, client.camera.image_height
        if self._sizes.get(client.client_id) == size:
            return
        self._sizes[client.client_id] = size
        answer = ask_browser(client, QUESTION)
        if answer is not None:
            self._fit(client, answer[1])

    def _fit(self, client: Any, width: float) -> None:
        """Place the panel for a window's width [px] unless it is placed for it already."""
        free = width - PANEL_WIDTH - 2.0 * FLOAT_GAP if SHEET < width < NARROW else 0.0
        if free == self._floats.get(client.client_id, 0.0):
            return
        self._floats[client.client_id] = free
        if free:
            float_below(client, self._panel, (free, FLOATING))
        else:
            dock_left(client, self._panel, PLOTS_WIDTH)
