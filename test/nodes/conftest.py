# SPDX-License-Identifier: Apache-2.0
"""What tests of nodes share."""

import signal

import pytest


@pytest.fixture(autouse=True)
def signal_handlers():
    """Take back the handlers of signals that a program sets which runs in the test's process."""
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    yield
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)
