# SPDX-License-Identifier: Apache-2.0
"""Serves the page's files, and one JSON channel to each visitor."""

import json
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from typing import Any
from uuid import uuid4

from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.sync.server import ServerConnection, serve

from rover_planner.viewer.state.background_work import Inbox

CHANNEL = "/channel"
"""Path of the channel; all others are files."""
FILES = {
    "/": ("page.html", "text/html"),
    "/page.js": ("page.js", "text/javascript"),
    "/page.css": ("page.css", "text/css"),
}
"""Files of the page and their kinds, by path."""
MAX_MESSAGE = 1 << 20
"""Most bytes that a visitor may send at once; a rover file has a few thousand."""

Part = Any
"""A part of what is shown: dicts, lists, texts, numbers, True, False and None."""
Mailbox = Inbox[Part]
"""Parts on their way to one visitor."""


class Channel:
    """Tells all visitors what is shown, part by part, and hears what they ask.

    To a browser: an object with the parts that have changed, by name; the first has all of them.
    From a browser: an object with the word `ask` and its values.
    """

    def __init__(self, host: str, port: int, hear: Callable[[dict[str, Any], Mailbox], None]):
        """Take the port; `hear` takes a visitor's words in a thread of theirs: it must be quick.

        It also gets where to answer.
        """
        self._hear = hear
        self._lock = threading.Lock()
        self.parts: Mapping[str, Part] = {"program": uuid4().hex}
        """Parts that are shown, by name."""
        self._mailboxes: set[Mailbox] = set()
        self._server = serve(
            self._serve, host, port, process_request=_answer, max_size=MAX_MESSAGE
        )
        self.port = int(self._server.socket.getsockname()[1])
        """The port."""
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)

    def open(self) -> None:
        """Serve those who wait, and who come: what they get first is all that was told so far."""
        self._thread.start()

    def tell(self, name: str, part: Part) -> None:
        """Show a part, if it differs from what is shown."""
        if name in self.parts and self.parts[name] == part:
            return
        with self._lock:
            self.parts = {**self.parts, name: part}
            for mailbox in self._mailboxes:
                mailbox.put(part, name)

    def close(self) -> None:
        """End it."""
        self._server.shutdown()
        for mailbox in tuple(self._mailboxes):
            mailbox.close()
        self._thread.join(5.0)

    def _serve(self, connection: ServerConnection) -> None:
        with self._lock:
            mailbox: Mailbox = Inbox(self.parts)
            self._mailboxes.add(mailbox)
        sender = threading.Thread(target=_send, args=(connection, mailbox), daemon=True)
        sender.start()
        try:
            for message in connection:
                words: Any = None
                with suppress(ValueError, RecursionError):  # what is no JSON is no question
                    words = json.loads(message)
                if isinstance(words, dict):
                    self._hear(words, mailbox)
        except ConnectionClosed:
            pass
        finally:
            with self._lock:
                self._mailboxes.discard(mailbox)
            mailbox.close()


def _send(connection: ServerConnection, mailbox: Mailbox) -> None:
    """Send what a mailbox gets until it is closed."""
    try:
        while mailbox.wait():
            connection.send(json.dumps(mailbox.take(), allow_nan=False))
    except ConnectionClosed:
        return
    connection.close()


def _answer(connection: ServerConnection, request: Request) -> Response | None:
    """Answer with a file of the page; None goes on to the channel."""
    path = request.path.partition("?")[0]
    if path == CHANNEL:
        origin, host = request.headers.get("Origin", ""), request.headers.get("Host", "")
        if origin.partition("://")[2] == host:  # no other site may change what is shown
            return None
        return connection.respond(HTTPStatus.FORBIDDEN, "the page of this program only\n")
    if path not in FILES:
        return connection.respond(HTTPStatus.NOT_FOUND, f"no {path}\n")
    name, kind = FILES[path]
    response = connection.respond(HTTPStatus.OK, read_file(name))
    del response.headers["Content-Type"]
    response.headers["Content-Type"] = f"{kind}; charset=utf-8"
    response.headers["Cache-Control"] = "no-store"
    return response


def read_file(name: str) -> str:
    """Return the text of a file of the page."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
