"""What a visitor's browser needs when it connects: script, link, and panels that fit in."""

from collections.abc import Callable
from typing import Any

from rover_planner.viewer.browser.channel import ask_browser, place_below
from rover_planner.viewer.panel.header import NARROW

QUESTION = "[location.search, window.innerWidth]"


class Visitors:
    """Greets each visitor, and stacks the panels in narrow windows."""

    def __init__(self, panel: Any, open_link: Callable[[str], None]):
        """Greet nobody yet.

        Args:
            panel: The panel that goes below the main one in narrow windows.
            open_link: Called with the query of the address of each visitor.
        """
        self._panel, self._open_link = panel, open_link
        self._stacked: dict[int, bool] = {}
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
        self._stacked.pop(client.client_id, None)
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
        stacks = width < NARROW
        if stacks != self._stacked.get(client.client_id, False):
            self._stacked[client.client_id] = stacks
            place_below(client, self._panel, stacks)
