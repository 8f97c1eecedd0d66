"""Parameters of every node that takes a map: how its cells and its publishers are chosen."""

from msg_adapters.gridding import CELL_HEIGHTS
from rover_planner.parameters.spec import ParameterSpec

MAP_DURABILITIES = ("either", "transient_local", "volatile")
"""Which publishers of a map are heard; see `rover_planner.ros.qos.map_subscriptions_qos`."""

MAP_INTAKE = (
    ParameterSpec(
        "map_resolution",
        0.0,
        "Cell size for clouds; 0 takes their spacing where they are a regular grid.",
        "m",
        bounds=(0.0, 10.0),
    ),
    ParameterSpec(
        "cell_height",
        "max",
        "Height of a cell with several points; max keeps obstacles, mean is unbiased.",
        choices=CELL_HEIGHTS,
    ),
    ParameterSpec(
        "map_durability",
        "either",
        "Publishers of the map that are heard, by their durability.",
        choices=MAP_DURABILITIES,
        read_only=True,
    ),
)
"""How a node takes maps."""
