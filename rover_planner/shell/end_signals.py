# SPDX-License-Identifier: Apache-2.0
"""Makes a command end in order when the system asks it to."""

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType

END_SIGNALS = (signal.SIGTERM, signal.SIGHUP)
"""Signals of batch systems and closed terminals."""


@contextlib.contextmanager
def end_as_by_ctrl_c() -> Iterator[None]:
    """Let SIGTERM and SIGHUP end the block as Ctrl-C does, so that child processes end in order.

    A signal that is ignored or handled already stays so, such as SIGHUP under nohup.
    """

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    is_main = threading.current_thread() is threading.main_thread()
    mine = [one for one in END_SIGNALS if is_main and signal.getsignal(one) == signal.SIG_DFL]
    for one in mine:
        signal.signal(one, interrupt)
    try:
        yield
    finally:
        for one in mine:
            signal.signal(one, signal.SIG_DFL)
