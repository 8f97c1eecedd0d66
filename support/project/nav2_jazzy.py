# SPDX-License-Identifier: Apache-2.0
"""Names of Nav2 1.3, that of Jazzy, as its sources have them: it is not on PyPI.

Read in the branch jazzy of ros-navigation/navigation2 at 1.3.13; 1.3.0 has the same error codes.
"""

COMPUTE_PATH_TO_POSE = {
    "NONE": 0,
    "UNKNOWN": 200,
    "INVALID_PLANNER": 201,
    "TF_ERROR": 202,
    "START_OUTSIDE_MAP": 203,
    "GOAL_OUTSIDE_MAP": 204,
    "START_OCCUPIED": 205,
    "GOAL_OCCUPIED": 206,
    "TIMEOUT": 207,
    "NO_VALID_PATH": 208,
}
"""Constants of the action's result."""
COSTMAP = {
    "plugins": list,
    "filters": list,
    "global_frame": str,
    "robot_base_frame": str,
    "rolling_window": bool,
    "track_unknown_space": bool,
    "trinary_costmap": bool,
    "lethal_cost_threshold": int,
    "unknown_cost_value": int,
}
"""Type of each parameter of a costmap that is used here."""
PLUGINS = {
    "nav2_costmap_2d::StaticLayer": {
        "enabled": bool,
        "map_topic": str,
        "map_subscribe_transient_local": bool,
        "subscribe_to_updates": bool,
        "transform_tolerance": float,
        "footprint_clearing_enabled": bool,
    },
    "nav2_costmap_2d::KeepoutFilter": {
        "enabled": bool,
        "filter_info_topic": str,
        "transform_tolerance": float,
        "override_lethal_cost": bool,
        "lethal_override_cost": float,
    },
}
"""Type of each parameter of a layer or filter, by its class."""
FILTER_INFO = {
    "type": int,
    "filter_info_topic": str,
    "mask_topic": str,
    "base": float,
    "multiplier": float,
}
"""Type of each parameter of costmap_filter_info_server."""
