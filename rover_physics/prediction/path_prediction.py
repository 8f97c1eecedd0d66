"""What the model predicts along a path: one frozen record of arrays, a row per waypoint."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.read_only import freeze_fields
from rover_physics.prediction.path_bounds import PathBounds


@dataclass(frozen=True, eq=False)
class PathPrediction:
    """The rover along a path of n waypoints; NaN where it did not settle; order as in `names`.

    All arrays are read-only.
    """

    poses: Floats
    """(n, 3) x, y [m] and yaw [rad] of the body origin, map frame, as asked for."""
    status: NDArray[np.int8]
    """(n,) a PoseStatus each."""
    settled: NDArray[np.bool_]
    """(n,) True where all wheels touch the ground and the forces balance."""
    position: Floats
    """(n, 3) body origin [m], map frame."""
    roll: Floats
    """(n,) roll [rad]."""
    pitch: Floats
    """(n,) pitch [rad], positive lowers the nose."""
    rocker_angle: Floats
    """(n, 2) rocker angles relative to the body [rad]."""
    bogie_angle: Floats
    """(n, 2) bogie angles relative to their rockers [rad]."""
    wheel_centres: Floats
    """(n, 6, 3) wheel centres [m], map frame."""
    contact_points: Floats
    """(n, 6, 3) where the wheels touch [m], map frame."""
    contact_angle: Floats
    """(n, 6) angle of the contact from the lowest point of the wheel, positive in front [rad]."""
    wheel_loads: Floats
    """(n, 6) normal forces N on the wheels [N]."""
    tangential: Floats
    """(n, 6) tractions T along the wheels' headings [N]."""
    lateral: Floats
    """(n, 6) lateral forces S along the wheels' axes, positive to the left [N]."""
    torque: Floats
    """(n, 6) motor torques [N m], positive forward."""
    friction: Floats
    """(n, 6) friction coefficient mu at the contact; on yielding soil the largest drawbar pull
    over the wheel load."""
    friction_utilisation: Floats
    """(n, 6) sqrt(T^2 + S^2) / (mu N), the paper's S_r; infinite for a wheel that lifts off; on
    yielding soil (T, S) relative to the largest forces in their direction."""
    slip_ratio: Floats
    """(n, 6) i = 1 - v / (r omega) from the soil model."""
    torque_saturation: Floats
    """(n, 6) |torque| / largest torque."""
    sinkage: Floats
    """(n, 6) how deep the wheels sink into yielding soil [m]."""
    motion_resistance: Floats
    """(n, 6) resistance of the soil that the torque overcomes beside the traction [N]."""
    tip_over_ratio: Floats
    """(n,) smallest tip-over angle now / on flat ground (the paper's stability margin)."""
    tip_over_force_angle: Floats
    """(n,) force-angle measure (Papadopoulos and Rey) now / on flat ground."""
    belly_clearance: Floats
    """(n,) smallest height of the underside above the ground [m]."""
    power: Floats
    """(n,) mechanical power of the wheel motors; braking gives nothing back [W]."""
    energy: Floats
    """(n,) mechanical energy spent since the first waypoint, settled stretches only [J]."""
    time: Floats
    """(n,) time since the first waypoint at nominal speed [s]."""
    distance: Floats
    """(n,) way since the first waypoint, in the plane [m]."""
    wheel_drop: Floats
    """(n, 6) how far a wheel that rolled off an edge has dropped when it comes here [m]."""
    falling: NDArray[np.bool_]
    """(n, 6) True for wheels that roll off an edge here: no equilibrium is asked for."""
    between: "PathPrediction | None"
    """Poses between waypoints where contacts jump, as on faces and edges; None in itself."""
    waypoint: NDArray[np.int64]
    """(n,) index of the waypoint a row belongs to: its own, or the next if in between."""
    policy: str
    """Torque policy: "equal" or "optimal"."""
    bounds: PathBounds | None = None
    """Bounds on all this where the map is uncertain, added by `judge_path`."""

    def __post_init__(self) -> None:
        freeze_fields(self)
