# SPDX-License-Identifier: Apache-2.0
"""Packs a text, such as a rover file, into the letters of an address, and unpacks it again."""

import base64
import zlib

from rover_planner.errors import PlanningError

MAX_TEXT = 200_000
"""Most bytes that are unpacked; a few letters can hold far more."""


def pack_text(text: str) -> str:
    """Return a text in letters that an address may hold, compressed."""
    return base64.urlsafe_b64encode(zlib.compress(text.encode(), 9)).decode().rstrip("=")


def unpack_text(packed: str) -> str:
    """Return the text that `pack_text` has packed.

    Raises:
        PlanningError: It is damaged, or larger than MAX_TEXT.
    """
    unpacker = zlib.decompressobj()
    try:
        data = base64.urlsafe_b64decode(packed + "=" * (-len(packed) % 4))
        text = unpacker.decompress(data, MAX_TEXT).decode()
    except (ValueError, zlib.error) as error:
        raise PlanningError(f"the rover file in the link is damaged ({error})") from error
    if not unpacker.eof:
        raise PlanningError(
            f"the rover file in the link is cut off, or larger than {MAX_TEXT} bytes"
        )
    return text
