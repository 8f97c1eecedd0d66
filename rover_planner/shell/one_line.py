# SPDX-License-Identifier: Apache-2.0
"""Puts any text into one short line that a terminal can show."""

MAX_LINE = 300
"""Largest number of characters of a line on stderr."""


def one_line(text: str, most: int = MAX_LINE) -> str:
    """Return a text without line breaks and control characters, cut to `most` characters."""
    words = " ".join(text[: 10 * most].split())
    shown = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in words)
    return shown if len(shown) <= most else f"{shown[: most - 3]}..."
