# SPDX-License-Identifier: Apache-2.0
"""The tab to share what is shown: as one HTML file, or as a link to this page."""

import html
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ShareActions:
    """What the buttons do; each gets the visitor's client of viser."""

    save: Callable[[Any], None]
    """Sends the file."""
    link: Callable[[Any], None]
    """Makes the link."""


class ShareTab:
    """Two buttons with what they are for."""

    def __init__(self, gui: Any, actions: ShareActions):
        """Add the contents to the container that is open."""
        gui.add_html(
            _text(
                "One HTML file with the scene, the failing pose, all numbers and versions. It "
                "opens in any browser, without this program."
            )
        )
        save = gui.add_button("Save as HTML file")
        save.on_click(lambda event: actions.save(event.client))
        gui.add_html(
            _text(
                "A link to this page that holds rover (also one of a file), changed values, ends, "
                "path, time and colours. It is put into the address bar and the clipboard."
            )
        )
        link = gui.add_button("Link to what is shown")
        link.on_click(lambda event: actions.link(event.client))
        self._link = gui.add_html("")

    def show_link(self, query: str) -> None:
        """Show a link as text to copy; none if it is empty."""
        if not query:
            self._link.content = ""
            return
        safe = html.escape(f"?{query}", quote=True)
        self._link.content = _text(
            f'<a id="link" href="{safe}" style="overflow-wrap:anywhere">{safe}</a>'
        )


def _text(text: str) -> str:
    return f'<div style="font-size:12px;padding:4px 8px">{text}</div>'
