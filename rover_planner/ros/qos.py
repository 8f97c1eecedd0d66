# SPDX-License-Identifier: Apache-2.0
"""Quality-of-service profiles of all topics, by purpose."""

from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)

from rover_planner.parameters.shared import (
    BEST_EFFORT,
    EITHER,
    RELIABLE,
    TRANSIENT_LOCAL,
    VOLATILE,
)

RELIABILITY, DURABILITY = QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY


def topic_qos() -> QoSProfile:
    """Return the profile of ordinary topics: reliable, depth 10."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.RELIABLE
    )


def result_qos() -> QoSProfile:
    """Return the profile of results: reliable and transient local, for late subscribers."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


def latched_qos() -> QoSProfile:
    """Return the profile of states: late subscribers get the last one."""
    return map_qos()


def sensor_qos() -> QoSProfile:
    """Return the profile of sensor data: best effort, which matches every publisher."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=5, reliability=ReliabilityPolicy.BEST_EFFORT
    )


def input_qos(reliability: str) -> QoSProfile:
    """Return the profile of subscriptions to requests, such as paths: depth 10.

    Args:
        reliability: One of `RELIABILITIES`.
    """
    return replace_reliability(topic_qos(), reliability)


def replace_reliability(profile: QoSProfile, reliability: str) -> QoSProfile:
    """Set the reliability of a profile, one of `RELIABILITIES`, and return the profile."""
    best_effort = reliability == BEST_EFFORT
    profile.reliability = (
        ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE
    )
    return profile


def map_qos(durability: DurabilityPolicy = DurabilityPolicy.TRANSIENT_LOCAL) -> QoSProfile:
    """Return the profile of maps: reliable, depth 1."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )


def map_subscriptions_qos(durability: str) -> list[QoSProfile]:
    """Return the profiles of `map_subscriptions` alone, reliable."""
    return [profile for profile, _ in map_subscriptions(durability)]


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
        Per subscription its profile, and what to do about publishers that it does not match, for
        `warn_of_mismatch`.
    """
    transient_local = map_qos(DurabilityPolicy.TRANSIENT_LOCAL)
    volatile = map_qos(DurabilityPolicy.VOLATILE)
    hear = {RELIABILITY: f"set input_reliability to {BEST_EFFORT}, or publish it reliably"}
    late = {DURABILITY: f"set map_durability to {EITHER} or {VOLATILE}"}
    chosen = {
        # With both kinds, only the volatile one tells: it misses what neither hears.
        EITHER: [(transient_local, {}), (volatile, hear)],
        TRANSIENT_LOCAL: [(transient_local, {**hear, **late})],
        VOLATILE: [(volatile, hear)],
    }[durability]
    return [(replace_reliability(profile, reliability), mends) for profile, mends in chosen]


def service_qos() -> QoSProfile:
    """Return the profile of services that many clients may call at once."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=100, reliability=ReliabilityPolicy.RELIABLE
    )
