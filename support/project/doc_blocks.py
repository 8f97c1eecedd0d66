# SPDX-License-Identifier: Apache-2.0
"""Code blocks of README and docs."""

import re
from dataclasses import dataclass
from pathlib import Path

from support.project.checkout import TOP

_BLOCK = re.compile(
    r"(?:<!-- not run: (?P<not_run>[^\n]+) -->\n)?"
    r"^```(?P<language>sh|python)\n(?P<text>.*?)^```$"
    r"(?:\s*^```text\n(?P<output>.*?)^```$)?",
    re.MULTILINE | re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A code block of a page."""

    page: str
    """Path of the page from the top of the checkout."""
    line: int
    """Line of the page where its text begins."""
    language: str
    """Language named behind the opening backquotes."""
    text: str
    """Content of the block."""
    not_run: str
    """Why the page says that it is not run, in a comment before it; empty without one."""
    output: str | None
    """Its printed output, where a block of text follows at once; else None."""

    def __str__(self) -> str:
        """Return page and line, as tools write them."""
        return f"{self.page}:{self.line}"


def read_blocks(page: Path) -> list[Block]:
    """Return the blocks of a page in sh and Python, from top to bottom."""
    text = page.read_text(encoding="utf-8")
    return [
        Block(
            page.relative_to(TOP).as_posix(),
            text[: match.start("text")].count("\n") + 1,
            match["language"],
            match["text"],
            match["not_run"] or "",
            match["output"],
        )
        for match in _BLOCK.finditer(text)
    ]
