# SPDX-License-Identifier: Apache-2.0
"""Reads fields of serialised messages, without making a message of them all."""

import struct
from typing import Any


class Fields:
    """Reads the fields of a serialised message (CDR) one after the other.

    Where the message ends early, struct.error is raised.
    """

    def __init__(self, message: bytes):
        """Begin behind the first four bytes, which tell the order of the others."""
        self._message, self._order = message, "<" if message[1:2] == b"\1" else ">"
        self.at = 4
        """Where the next field begins, before its alignment."""

    def numbers(self, form: str) -> tuple[Any, ...]:
        """Return numbers of one size in a format of struct, such as "iI" or "4d"."""
        form = self._order + form
        self.at += (4 - self.at) % struct.calcsize(self._order + form[-1])
        found = struct.unpack_from(form, self._message, self.at)
        self.at += struct.calcsize(form)
        return found

    def skip(self, known: bytes) -> bool:
        """Go on behind bytes that are known, if they come next; return whether they do."""
        if not known or not self._message.startswith(known, self.at):
            return False
        self.at += len(known)
        return True

    def since(self, begin: int) -> bytes:
        """Return the bytes that were read since a place."""
        return self._message[begin : self.at]

    def count(self) -> int:
        """Return the number of elements of a sequence."""
        return int(self.numbers("I")[0])

    def text(self) -> str:
        """Return a text."""
        length = self.count()
        begin, self.at = self.at, self.at + length
        return self._message[begin : self.at - 1].decode(errors="replace")

    def view(self) -> memoryview:
        """Return a view of a sequence of bytes."""
        length = self.count()
        begin, self.at = self.at, self.at + length
        return memoryview(self._message)[begin : self.at]

    def doubles(self) -> tuple[float, ...]:
        """Return a sequence of doubles."""
        count = self.count()
        return self.numbers(f"{count}d") if count else ()
