# SPDX-License-Identifier: Apache-2.0
"""Quality-of-service profiles of all topics, by purpose."""

from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy

from rover_planner.parameters.shared import (
    BEST_EFFORT,
    EITHER,
    RELIABLE,
    TRANSIENT_LOCAL,
    VOLATILE,
)

HEAR_BEST_EFFORT = {
    QoSPolicyKind.RELIABILITY: f"set input_reliability to {BEST_EFFORT}, or publish it reliably"
}
"""Advice about best-effort publishers of what is subscribed to reliably."""
HEAR_VOLATILE = {QoSPolicyKind.DURABILITY: f"set map_durability to {EITHER} or {VOLATILE}"}
"""Advice about volatile publishers of what is subscribed to as transient local."""


def make_qos(depth: int, reliability: str = RELIABLE, durability: str = VOLATILE) -> QoSProfile:
    """Return a profile; its policies are named as in the parameters."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )


TOPIC_QOS = make_qos(10)
"""Ordinary topics."""
RESULT_QOS = make_qos(10, durability=TRANSIENT_LOCAL)
"""Results: late subscribers get them, too."""
LATCHED_QOS = make_qos(1, durability=TRANSIENT_LOCAL)
"""Maps and states: late subscribers get the last one."""
SENSOR_QOS = make_qos(5, BEST_EFFORT)
"""Sensor data; best effort matches every publisher."""
POLLED_QOS = make_qos(20, BEST_EFFORT)
"""Sensor data at up to 200 Hz that is read ten times a second."""
NEWEST_QOS = make_qos(1, BEST_EFFORT)
"""Sensor data of which only the last message matters."""
SERVICE_QOS = make_qos(100)
"""Services that many clients may call at once."""


def joints_qos(period: float) -> QoSProfile:
    """Return the profile of joint states, up to 1000 Hz in all, that are read each period [s].

    Several publishers share the topic: a fast one may not push out what a slow one has sent.
    """
    return make_qos(round(1000.0 * period), BEST_EFFORT)


def map_subscriptions(
    durability: str, reliability: str = RELIABLE
) -> list[tuple[QoSProfile, dict[QoSPolicyKind, str]]]:
    """Return profile and mends of the subscriptions to a map, one per subscription.

    A transient-local subscription gets a map that was published earlier, but does not match a
    volatile publisher. A volatile one matches both, but only gets the next map. EITHER needs one
    subscription of each kind, and the subscriber must ignore the second copy.

    Args:
        durability: One of `MAP_DURABILITIES`.
        reliability: One of `RELIABILITIES`.

    Returns:
        Per subscription its profile, and what to do about publishers that it does not match.
    """
    chosen = {
        # With both kinds, only the volatile one tells: it misses what neither hears.
        EITHER: [(TRANSIENT_LOCAL, {}), (VOLATILE, HEAR_BEST_EFFORT)],
        TRANSIENT_LOCAL: [(TRANSIENT_LOCAL, HEAR_BEST_EFFORT | HEAR_VOLATILE)],
        VOLATILE: [(VOLATILE, HEAR_BEST_EFFORT)],
    }[durability]
    return [(make_qos(1, reliability, kind), mends) for kind, mends in chosen]
