# SPDX-License-Identifier: Apache-2.0
"""What a visitor's browser needs when it connects: its link, and panels that fit in."""

import threading
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
        self._locks: dict[int, threading.Lock] = {}
        """One for each visitor: of two answers the later one is acted on last."""
        self.greeted: set[int] = set()
        """Numbers of the visitors' clients whose panels fit and whose links are opened."""

    def greet(self, client: Any) -> None:
        """Read a new visitor's address and fit the panels; it waits for the browser."""
        self._locks[client.client_id] = threading.Lock()
        client.camera.on_update(lambda _camera: self._resize(client))  # also while it waits
        query = self._ask_and_fit(client)
        if query:
            self._open_link(query)
        self.greeted.add(client.client_id)

    def forget(self, client: Any) -> None:
        """Forget a visitor who has left."""
        for known in (self._floats, self._sizes, self._locks):
            known.pop(client.client_id, None)
        self.greeted.discard(client.client_id)

    def _resize(self, client: Any) -> None:
        """Fit the panels again if the size of the picture has changed."""
        size = client.camera.image_width, client.camera.image_height
        if self._sizes.get(client.client_id) == size:
            return
        self._sizes[client.client_id] = size
        self._ask_and_fit(client)

    def _ask_and_fit(self, client: Any) -> str:
        """Place the panels for the window as it is now; return the query of its address."""
        with self._locks.get(client.client_id, threading.Lock()):
            answer = ask_browser(client, QUESTION)
            if answer is None:
                return ""
            query, width = answer
            self._fit(client, width)
            return str(query)

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
