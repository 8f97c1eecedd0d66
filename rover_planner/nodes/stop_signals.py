# SPDX-License-Identifier: Apache-2.0
"""Signals that tell a node to end, taken without ROS, so that it can still send what it must.

ROS's own handlers end the context at once: open questions would stay without an answer, and wheels
without their zero torques.
"""

import signal
from collections.abc import Callable
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)
LOOK_FOR_STOP = 0.5
"""Longest time between two looks whether a node is to end [s]; a signal wakes it earlier."""


class StopSignals:
    """Turns SIGINT and SIGTERM into KeyboardInterrupt while a node starts, then into a request.

    Only the first signal counts: launch and the terminal both send one, and the second may come
    when Python has ended so far that it would be killed by it.
    """

    def __init__(self) -> None:
        self.wanted = False
        """Whether the node is to end."""
        self._wake: Callable[[], object] | None = None
        for number in SIGNALS:
            signal.signal(number, self._ask)

    def defer(self, wake: Callable[[], object]) -> None:
        """From now on a signal only sets `wanted` and calls `wake`."""
        self._wake = wake

    def _ask(self, number: int, frame: FrameType | None) -> None:
        self.wanted = True
        for one in SIGNALS:
            signal.signal(one, signal.SIG_IGN)
        if self._wake is None:
            raise KeyboardInterrupt
        self._wake()
