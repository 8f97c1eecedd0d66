"""Joint state messages: measured joint angles by name."""

import math
from collections.abc import Collection

from sensor_msgs.msg import JointState

from msg_adapters.errors import MessageError


def joint_positions(state: JointState, wanted: Collection[str]) -> dict[str, float]:
    """Return the positions [rad] of the wanted joints that a message carries, by name.

    Joints that are not wanted are not looked at. A message without positions (only velocities or
    efforts, say) carries none.

    Raises:
        MessageError: position has another length than name, a wanted joint is named twice, or
            its position is not finite.
    """
    if not state.position:
        return {}
    if len(state.position) != len(state.name):
        raise MessageError(
            f"joint_states has {len(state.position)} positions for {len(state.name)} names; "
            "there must be one for each, or none at all"
        )
    positions: dict[str, float] = {}
    for name, position in zip(state.name, state.position, strict=True):
        if name not in wanted:
            continue
        if name in positions:
            raise MessageError(f"joint_states names {name} twice")
        if not math.isfinite(position):
            raise MessageError(
                f"joint_states has position {position} of {name}; it must be a finite angle in rad"
            )
        positions[name] = float(position)
    return positions
