"""Parameters that several nodes have, each written once."""

from msg_adapters.gridding import CELL_HEIGHTS
from rover_planner.parameters.table import ParameterError, parameter

OWN_PAYLOAD = -1.0
"""Value of the parameter payload that takes the payload of the rover file."""
EITHER, TRANSIENT_LOCAL, VOLATILE = "either", "transient_local", "volatile"
MAP_DURABILITIES = (EITHER, TRANSIENT_LOCAL, VOLATILE)
"""Values of the parameter map_durability; `rover_planner.ros.qos` says what they mean."""


def max_torque_parameter() -> float:
    """Return the field of the largest wheel torque."""
    return parameter(
        0.0,
        "Largest torque of a wheel; 0 takes the rover file's.",
        unit="N m",
        bounds=(0.0, 1e6),
    )


def payload_parameter() -> float:
    """Return the field of the payload; `payload_or_none` reads its value."""
    return parameter(
        OWN_PAYLOAD,
        "Mass at the tip of the manipulator; -1 takes the rover file's.",
        unit="kg",
        bounds=(OWN_PAYLOAD, 1e6),
    )


def payload_or_none(payload: float) -> float | None:
    """Return a payload [kg], None where it is that of the rover file.

    Raises:
        ParameterError: A mass below 0.
    """
    if payload == OWN_PAYLOAD:
        return None
    if payload < 0.0:
        raise ParameterError(
            f"parameter payload is {payload}; it must be a mass of 0 kg or more, "
            f"or {OWN_PAYLOAD:g} for that of the rover file"
        )
    return payload


def map_resolution_parameter() -> float:
    """Return the field of the cell size of a map."""
    return parameter(
        0.0,
        "Cell size for clouds; 0 takes their spacing where they are a regular grid.",
        unit="m",
        bounds=(0.0, 10.0),
    )


def cell_height_parameter() -> str:
    """Return the field of how a cell's height is chosen."""
    return parameter(
        CELL_HEIGHTS[0],
        "Height of a cell with several points; max keeps obstacles, mean is unbiased.",
        choices=CELL_HEIGHTS,
    )


def map_durability_parameter() -> str:
    """Return the field of the durability of the map's publishers."""
    return parameter(
        EITHER,
        "Durability of the map publishers to subscribe to.",
        choices=MAP_DURABILITIES,
        read_only=True,
    )
