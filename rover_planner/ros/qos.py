"""Quality of service by purpose, so that no node spells out its own."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rover_planner.parameters.shared import EITHER, TRANSIENT_LOCAL, VOLATILE


def topic_qos() -> QoSProfile:
    """Return the profile of ordinary topics: reliable, the last ten."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.RELIABLE
    )


def result_qos() -> QoSProfile:
    """Return the profile of results: as ordinary topics, and kept for whoever comes later."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


def sensor_qos() -> QoSProfile:
    """Return the profile of sensor data: best effort, so that every publisher is heard."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST, depth=5, reliability=ReliabilityPolicy.BEST_EFFORT
    )


def map_qos(durability: DurabilityPolicy = DurabilityPolicy.TRANSIENT_LOCAL) -> QoSProfile:
    """Return the profile of maps: reliable, only the latest."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=durability,
    )


def map_subscriptions_qos(durability: str) -> list[QoSProfile]:
    """Return the profiles with which to subscribe to a map, one subscription each.

    A transient-local subscription gets the map that was published before it came, but does not
    match a volatile publisher; a volatile one matches both, but waits for the next map. So
    EITHER takes both, and the subscriber has to pass over the second copy.

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
