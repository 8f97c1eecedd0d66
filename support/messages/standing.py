# SPDX-License-Identifier: Apache-2.0
"""What a simulated rover measures of its own pose and suspension."""

from rover_physics.names import SUSPENSION_JOINTS
from rover_physics.numerics.quaternions import rpy_from_xyzw
from rover_planner.simulator.plant import PlantState
from rover_planner.worlds.maps.ground_beneath import Standing


def standing_of(state: PlantState) -> Standing:
    """Return pose and suspension of a plant's state."""
    roll, pitch, yaw = rpy_from_xyzw(tuple(state.orientation.tolist()))
    x, y, z = state.position.tolist()
    suspension = {name: state.joint_positions[name] for name in SUSPENSION_JOINTS}
    return Standing(x, y, z, roll, pitch, yaw, suspension)
