"""Runs scripts in the browsers of visitors, and asks them what only they know.

viser has no public way for either. Its own parts that need a script send the message that is used
here; answers come back through the browser's local storage, which viser can read.
"""

import json
import uuid
from typing import Any

STORAGE_PREFIX = "viser-user:"
"""What viser's browser part puts before each key of the local storage."""
TIMEOUT = 10.0
"""Longest wait for an answer [s]."""


def run_script(server: Any, source: str) -> None:
    """Run a script in the browsers of all visitors, present and future.

    Args:
        server: The server of viser.
        source: JavaScript.
    """
    server.gui._websock_interface.queue_message(_script(source))


def run_for(client: Any, source: str) -> None:
    """Run a script in the browser of one visitor.

    Args:
        client: The visitor's client of viser.
        source: JavaScript.
    """
    client.gui._websock_interface.queue_message(_script(source))


def place_below(client: Any, panel: Any, below: bool) -> None:
    """Dock a panel below the main panel, or on the left, in the browser of one visitor alone.

    viser places panels for all visitors at once, whose windows differ in width.

    Args:
        client: The visitor's client of viser.
        panel: A panel of the server.
        below: Whether it goes below the main panel.
    """
    from viser._gui_handles import CONTROL_PANEL_ID
    from viser._messages import GuiSetPanelPositionMessage

    edge = {"kind": "edge", "edge": "left"}
    split = {"kind": "split", "anchor_uuid": CONTROL_PANEL_ID, "side": "below"}
    gui = panel._placement_gui_api
    client.gui._websock_interface.queue_message(
        GuiSetPanelPositionMessage(
            panel._placement_uuid,
            split if below else edge,  # type: ignore[arg-type]
            counter=gui._next_layout_counter(),
            run_id=gui._layout_run_id,
        )
    )


def ask_browser(client: Any, expression: str) -> Any:
    """Return the value of a JavaScript expression in the browser of a visitor.

    It waits, so it must not be called on the loop of viser. What the expression gives must be
    JSON.

    Args:
        client: The visitor's client of viser.
        expression: JavaScript.

    Returns:
        The value; None if there is no answer within TIMEOUT.
    """
    key = f"rover_planner-{uuid.uuid4().hex}"
    stored = json.dumps(STORAGE_PREFIX + key)
    run_for(client, f"localStorage.setItem({stored}, JSON.stringify({expression}));")
    try:
        answer = client.local_storage.get_item(key, TIMEOUT)
        client.local_storage.remove_item(key)
    except (RuntimeError, TimeoutError):
        return None
    return None if answer is None else json.loads(answer)


def _script(source: str) -> Any:
    from viser._messages import RunJavascriptMessage

    return RunJavascriptMessage(source)
