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


def topic_qos() -> QoSProfile:
    """Return the profile of ordinary topics: reliable, depth 10."""
    return QoSProfile(depth=10)


def result_qos() -> QoSProfile:
    """Return the profile of results: reliable and transient local, for late subscribers."""
    return QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def map_qos(durability: DurabilityPolicy = DurabilityPolicy.TRANSIENT_LOCAL) -> QoSProfile:
    """Return the profile of maps: reliable, depth 1."""
    return QoSProfile(depth=1, durability=durability)


def latched_qos() -> QoSProfile:
    """Return the profile of states: late subscribers get the last one."""
    return map_qos()


def sensor_qos() -> QoSProfile:
    """Return the profile of sensor data: best effort, which matches every publisher."""
    return QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)


def polled_qos() -> QoSProfile:
    """Return the profile of sensor data at up to 200 Hz that is read ten times a second."""
    return QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)


def joints_qos(period: float) -> QoSProfile:
    """Return the profile of joint states, up to 1000 Hz in all, that are read each period [s].

    Several publishers share the topic: a fast one may not push out what a slow one has sent.
    """
    return QoSProfile(depth=round(1000.0 * period), reliability=ReliabilityPolicy.BEST_EFFORT)


def newest_qos() -> QoSProfile:
    """Return the profile of sensor data of which only the last message matters."""
    return QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


def service_qos() -> QoSProfile:
    """Return the profile of services that many clients may call at once."""
    return QoSProfile(depth=100)


def replace_reliability(profile: QoSProfile, reliability: str) -> QoSProfile:
    """Set the reliability of a profile, one of `RELIABILITIES`, and return the profile."""
    best_effort = reliability == BEST_EFFORT
    profile.reliability = (
        ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
    )
    return profile


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
    transient_local, volatile = map_qos(), map_qos(DurabilityPolicy.VOLATILE)
    chosen = {
        # With both kinds, only the volatile one tells: it misses what neither hears.
        EITHER: [(transient_local, {}), (volatile, HEAR_BEST_EFFORT)],
        TRANSIENT_LOCAL: [(transient_local, HEAR_BEST_EFFORT | HEAR_VOLATILE)],
        VOLATILE: [(volatile, HEAR_BEST_EFFORT)],
    }[durability]
    return [(replace_reliability(profile, reliability), mends) for profile, mends in chosen]
