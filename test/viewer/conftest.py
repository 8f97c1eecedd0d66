# SPDX-License-Identifier: Apache-2.0
"""The browser that the tests of a file share."""

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from support.viewer.browser import open_browser

    with open_browser() as chromium:
        yield chromium
