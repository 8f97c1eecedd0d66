# SPDX-License-Identifier: Apache-2.0
"""Words that the page's scripts send to the server, through a text box that nobody sees.

viser has no public way for scripts to send anything; a text box sends what it holds at each
change.
"""

from collections.abc import Callable, Mapping
from typing import Any

PREFIX = "rover_planner:"
"""First word of what the box holds, by which the scripts find it."""
HIDE = '<div id="words"></div><style>:has(> #words)+*{display:none}</style>'

SCRIPT = r"""
(() => {
  if (window.__VISER_EMBED_DATA__ || window.roverPlannerSay) return;
  let count = 0;
  // Sends words; the count makes them differ from the last ones.
  window.roverPlannerSay = (words) => {
    const box = Array.from(document.querySelectorAll("input"))
      .find((one) => one.value.startsWith("PREFIX"));
    if (!box) return;
    count += 1;
    const native = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
    native.set.call(box, `PREFIX ${Date.now()}.${count} ${words}`);
    box.dispatchEvent(new Event("input", { bubbles: true }));
  };
})();
""".replace("PREFIX", PREFIX)
"""JavaScript; running it again changes nothing."""


class Words:
    """Calls an action for each word that a script sends.

    It gets the visitor's client of viser and the number behind the word.
    """

    def __init__(self, gui: Any, actions: Mapping[str, Callable[[Any, int], None]]):
        """Add the box to the container that is open.

        Args:
            gui: The GUI of viser.
            actions: Quick actions by their words; other words are ignored.
        """
        self._actions = actions
        gui.add_html(HIDE)
        gui.add_text("words", PREFIX).on_update(self._hear)

    async def _hear(self, event: Any) -> None:
        """Act on what a visitor's script has written; on viser's loop, so that none is lost."""
        _, _, word, number = (*event.target.value.split(), "", "", "", "")[:4]
        if event.client is not None and word in self._actions and number.isdecimal():
            self._actions[word](event.client, int(number))
