# SPDX-License-Identifier: Apache-2.0
"""Words that the page's script in a browser sends to the program, and the script itself.

viser has no public way for scripts to send anything; a text box sends what it holds at each
change. Nobody sees the box.
"""

import html
from collections.abc import Callable
from importlib.resources import files
from typing import Any

PREFIX = "rover_planner:"
"""First word of what the box holds, by which the script finds it."""
HIDDEN = (
    '<div id="words"></div><style>:has(> #words)+*{{display:none}}</style>'
    '<img src="data:," alt="" style="display:none" onerror="{script}">'
)
"""Hides the box behind it; an image that cannot be shown runs the script."""


def add_script(gui: Any, hear: Callable[[str, str], None]) -> None:
    """Add the script and its box to the container that is open.

    Args:
        gui: The GUI of viser.
        hear: Called quickly with each word that a visitor's script sends, and what follows it.
    """
    script = files(__package__).joinpath("page.js").read_text(encoding="utf-8")
    gui.add_html(HIDDEN.format(script=html.escape(script)))

    async def read(event: Any) -> None:  # on viser's loop, so that no words are lost
        words = event.target.value.split(" ", 3)
        if event.client is not None and len(words) == 4:
            hear(words[2], words[3])

    gui.add_text("words", PREFIX).on_update(read)
