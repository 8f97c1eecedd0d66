# SPDX-License-Identifier: Apache-2.0
"""Code blocks of README and docs."""

import itertools
import re
from dataclasses import dataclass
from pathlib import Path

from support.project.checkout import TOP

_FENCE = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_MARK = re.compile(r"<!-- not run: (.+) -->\n\Z")


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
    found = list(_FENCE.finditer(text))
    blocks = []
    for match, following in itertools.zip_longest(found, found[1:]):
        if match[1] not in ("sh", "python"):
            continue
        mark = _MARK.search(text[: match.start()])
        at_once = following is not None and not text[match.end() : following.start()].strip()
        output = following[2] if at_once and following[1] == "text" else None
        blocks.append(
            Block(
                page.relative_to(TOP).as_posix(),
                text[: match.start()].count("\n") + 2,
                match[1],
                match[2],
                mark[1] if mark else "",
                output,
            )
        )
    return blocks
