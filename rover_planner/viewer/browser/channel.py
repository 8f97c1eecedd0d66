# SPDX-License-Identifier: Apache-2.0
"""Runs scripts in the browsers of visitors, and asks them what only they know.

viser has no public way for either. Its own parts that need a script send the message that is used
here; answers come back through the browser's local storage, which viser can read.
"""

import json
import uuid
from typing import Any

STORAGE_PREFIX = "viser-user:"
"""What viser's browser part puts before each key of the local storage."""
TIMEOUT = 60.0
"""Longest wait for an answer [s]."""
FLOAT_GAP = 4
"""Distance of a floating panel from the edges of the scene [px]."""


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


def show_to(client: Any, node: Any, **properties: Any) -> None:
    """Change properties of a node of the scene in the browser of one visitor alone.

    The change lasts until the same property is set for all visitors, or the node is drawn anew.

    Args:
        client: The visitor's client of viser.
        node: The node's handle of the server's scene.
        properties: New values by name.
    """
    from viser._messages import SceneNodeUpdateMessage

    message = SceneNodeUpdateMessage(node.name, properties)
    client.gui._websock_interface.queue_message(message)


def dock_left(client: Any, panel: Any, width: float) -> None:
    """Dock a panel on the left in the browser of one visitor alone; it waits for the browser.

    viser places panels for all visitors at once, whose windows differ in width. A panel keeps the
    width that it had while it floated if the new one comes together with the new place.

    Args:
        client: The visitor's client of viser.
        panel: A panel of the server.
        width: Its width [px].
    """
    from viser import _messages

    _arrange(client, panel, _messages.GuiSetPanelPositionMessage, {"kind": "edge", "edge": "left"})
    ask_browser(client, "null")
    _arrange(client, panel, _messages.GuiSetPanelWidthMessage, width)


def float_below(client: Any, panel: Any, size: tuple[float, float]) -> None:
    """Let a panel float over the lower edge of the scene in the browser of one visitor alone.

    Args:
        client: The visitor's client of viser.
        panel: A panel of the server.
        size: Its width and height [px].
    """
    from viser import _messages

    place = {"kind": "float", "x": FLOAT_GAP, "y": -FLOAT_GAP}
    _arrange(client, panel, _messages.GuiSetPanelPositionMessage, place)
    _arrange(client, panel, _messages.GuiSetPanelWidthMessage, size[0])
    _arrange(client, panel, _messages.GuiSetPanelHeightMessage, size[1])


def _arrange(client: Any, panel: Any, kind: Any, value: Any) -> None:
    """Send a message about a panel to one visitor."""
    gui = panel._placement_gui_api
    client.gui._websock_interface.queue_message(
        kind(panel._placement_uuid, value, gui._next_layout_counter(), gui._layout_run_id)
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
