# SPDX-License-Identifier: Apache-2.0
"""Code blocks of README and docs."""

import re
from dataclasses import dataclass
from pathlib import Path

_BLOCK = re.compile(
    r"(?:<!-- not run: (?P<not_run>[^\n]+) -->\n)?"
    r"^```(?P<language>sh|python)\n(?P<text>.*?)^```$"
    r"(?:\s*^```text\n(?P<output>.*?)^```$)?",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A code block of a page."""

    language: str
    """Language named behind the opening backquotes."""
    text: str
    """Content of the block."""
    not_run: str
    """Why the page says that it is not run, in a comment before it; empty without one."""
    output: str | None
    """Its printed output, where a block of text follows at once; else None."""


def read_blocks(page: Path) -> list[Block]:
    """Return the blocks of a page in sh and Python, from top to bottom."""
    return [
        Block(one["language"], one["text"], one["not_run"] or "", one["output"])
        for one in _BLOCK.finditer(page.read_text(encoding="utf-8"))
    ]
