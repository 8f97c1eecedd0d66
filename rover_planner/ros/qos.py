"""Quality-of-service profiles of all topics, by purpose."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rover_planner.parameters.shared import EITHER, TRANSIENT_LOCAL, VOLATILE


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


def sensor_qos() -> QoSProfile:
    """Return the profile of sensor data: best effort, which matches every publisher."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=5, reliability=ReliabilityPolicy.BEST_EFFORT
    )


def map_qos(durability: DurabilityPolicy = DurabilityPolicy.TRANSIENT_LOCAL) -> QoSProfile:
    """Return the profile of maps: reliable, depth 1."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )


def map_subscriptions_qos(durability: str) -> list[QoSProfile]:
    """Return the profiles of subscriptions to a map, one per subscription.

    A transient-local subscription gets a map that was published earlier, but does not match a
    volatile publisher. A volatile one matches both, but only gets the next map. EITHER needs one
    subscription of each kind, and the subscriber must ignore the second copy.

    Args:
        durability: One of `MAP_DURABILITIES`.
    """
    transient_local = map_qos(DurabilityPolicy.TRANSIENT_LOCAL)
    volatile = map_qos(DurabilityPolicy.VOLATILE)
    return {
        EITHER: [transient_local, volatile],
        TRANSIENT_LOCAL: [transient_local],
        VOLATILE: [volatile],
    }[durability]
