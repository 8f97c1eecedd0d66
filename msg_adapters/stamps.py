# SPDX-License-Identifier: Apache-2.0
"""Converts stamps of messages to nanoseconds and back; maps use it where ROS is absent, too."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from builtin_interfaces.msg import Time

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second."""


def stamp_to_ns(stamp: "Time") -> int | None:
    """Return a stamp [ns]; None if it is zero, which means that the sender set none."""
    total = stamp.sec * NANOSECONDS + stamp.nanosec
    return total or None


def ns_to_stamp(time: int) -> "Time":
    """Return a time [ns] as a stamp."""
    from builtin_interfaces.msg import Time

    return Time(sec=time // NANOSECONDS, nanosec=time % NANOSECONDS)
