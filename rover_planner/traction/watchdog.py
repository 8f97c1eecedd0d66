# SPDX-License-Identifier: Apache-2.0
"""A watchdog in a thread of its own: it acts when commands are not renewed in time.

It counts on the monotonic clock and sleeps relative times, so a step of the system clock cannot
delay it. It cannot act while another thread holds Python's interpreter lock, or when the process
hangs: a rover needs a hardware watchdog as well.
"""

import threading
import time
import traceback
from collections.abc import Callable

POLL = 0.01
"""Time between two actions of the thread [s]."""
LONGEST = 0.05
"""Longest sleep of the thread while a command is valid [s]: a later one may expire earlier."""
SHORTEST = 0.001
"""Shortest sleep of the thread [s]."""


class Watchdog:
    """Calls a function while the last command has expired; commands pass through it."""

    def __init__(self, act: Callable[[], None]):
        """Start the thread; `act` is called in it, about every POLL, while nothing is valid."""
        self._act = act
        self._lock = threading.Lock()
        self._deadline = float("inf")
        self._acted_at = float("-inf")
        self.trips = 0
        """Number of times that commands expired."""
        self._ending = False
        self._thread = threading.Thread(target=self._run, name="watchdog", daemon=True)
        self._thread.start()

    def send(self, command: Callable[[], None], started: float, deadline: float) -> bool:
        """Send a command that is valid until a deadline.

        Args:
            command: Sends it.
            started: Monotonic time at which its computation began [s]. If the watchdog has acted
                since, the command is too late and is not sent.
            deadline: Monotonic time at which the watchdog acts [s].

        Returns:
            Whether it was sent in time. If not, it may have been sent while the watchdog acted:
            then the watchdog goes on acting, and the caller does well to send zeros at once.
        """
        with self._lock:
            if self._acted_at < started:
                command()
            if self._acted_at >= started:
                return False
            self._deadline = deadline
        return True

    def close(self) -> None:
        """End the thread."""
        self._ending = True
        self._thread.join()

    def _run(self) -> None:
        tripped = False
        while not self._ending:
            now = time.monotonic()
            if now < self._deadline:
                tripped = False
                time.sleep(min(max(self._deadline - now, SHORTEST), LONGEST))
                continue
            # A thread that hangs while it sends must not keep the watchdog from acting.
            locked = self._lock.acquire(timeout=POLL)
            try:
                if time.monotonic() >= self._deadline:
                    self._acted_at = time.monotonic()
                    self.trips += not tripped
                    tripped = True
                    self._act()
            except Exception:
                # An error must not end the thread: the next attempt may work.
                traceback.print_exc()
            finally:
                if locked:
                    self._lock.release()
            time.sleep(POLL)
