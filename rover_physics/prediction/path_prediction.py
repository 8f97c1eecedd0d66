"""Prediction of the rover along a path: one frozen record of arrays, a row per waypoint."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats
from rover_physics.numerics.read_only import freeze_fields
from rover_physics.prediction.path_bounds import PathBounds


@dataclass(frozen=True, eq=False)
class PathPrediction:
    """Prediction at n waypoints; NaN where the rover did not settle.

    Wheels and sides are in the order of `names`. All arrays are read-only.
    """

    poses: Floats
    """(n, 3) x, y [m] and yaw [rad] of the body origin, map frame, as given."""
    status: NDArray[np.int8]
    """(n,) PoseStatus of each waypoint."""
    settled: NDArray[np.bool_]
    """(n,) True where all wheels touch the ground and the forces balance."""
    position: Floats
    """(n, 3) body origin [m], map frame."""
    roll: Floats
    """(n,) roll [rad]."""
    pitch: Floats
    """(n,) pitch [rad], positive nose down."""
    rocker_angle: Floats
    """(n, 2) rocker angles relative to the body [rad]."""
    bogie_angle: Floats
    """(n, 2) bogie angles relative to their rockers [rad]."""
    wheel_centres: Floats
    """(n, 6, 3) wheel centres [m], map frame."""
    contact_points: Floats
    """(n, 6, 3) contact points of the wheels [m], map frame."""
    contact_angle: Floats
    """(n, 6) angle from the lowest point of the wheel to the contact, positive in front [rad]."""
    wheel_loads: Floats
    """(n, 6) normal forces N on the wheels [N]."""
    tangential: Floats
    """(n, 6) tractions T along the wheels' headings [N]."""
    lateral: Floats
    """(n, 6) lateral forces S along the wheels' axes, positive to the left [N]."""
    torque: Floats
    """(n, 6) motor torques [N m], positive forward."""
    friction: Floats
    """(n, 6) friction coefficient mu at the contact; on yielding soil: the largest drawbar pull
    over the wheel load."""
    friction_utilisation: Floats
    """(n, 6) sqrt(T^2 + S^2) / (mu N), the paper's S_r; infinite for a wheel that lifts off, 0
    under policy "servo". On yielding soil: (T, S) relative to the largest forces in their
    direction."""
    slip_ratio: Floats
    """(n, 6) i = 1 - v / (r omega), from the soil model or from the servos."""
    torque_saturation: Floats
    """(n, 6) |torque| / largest torque."""
    sinkage: Floats
    """(n, 6) sinkage of the wheels in yielding soil [m]."""
    motion_resistance: Floats
    """(n, 6) motion resistance of the soil [N]; the torque overcomes it besides the traction."""
    tip_over_ratio: Floats
    """(n,) smallest tip-over angle over that on flat ground (the paper's stability margin)."""
    tip_over_force_angle: Floats
    """(n,) force-angle measure (Papadopoulos and Rey) over that on flat ground."""
    belly_clearance: Floats
    """(n,) smallest height of the underside above the ground [m]."""
    power: Floats
    """(n,) mechanical power of the wheel motors; braking motors count as 0 [W]."""
    speed_share: Floats
    """(n,) share of the commanded motion that the rover makes: 0 where no forward speed balances;
    always 1 under other policies than "servo"."""
    stalls: Floats
    """(n,) why no forward speed balances: 0 the wheels slide, 1 the motors stall, 2 a wheel is
    wedged between faces in front and behind; 0 where one does."""
    slip_speed: Floats
    """(n, 6) speed at which the treads slide over the ground under policy "servo" [m/s]."""
    lift_rate: Floats
    """(n, 6) speed at which wheels lift off the ground under policy "servo", over the nominal
    speed."""
    lift_height: Floats
    """(n, 6) height to which wheels have lifted under policy "servo" [m]."""
    deviation: Floats
    """(n, 3) motion beyond the share of the commanded one under policy "servo": forward and to the
    left, over the nominal speed, and turning left, [rad] per metre of nominal way."""
    drift: Floats
    """(n, 2) turn [rad] and way [m] off the path that build up within the last wheelbase under
    policy "servo"."""
    energy: Floats
    """(n,) mechanical energy spent since the first waypoint; poses that are not settled count as
    0 W [J]."""
    time: Floats
    """(n,) time since the first waypoint at nominal speed, under policy "servo" at the share of it
    that is made [s]. Where wheels take longer to turn than the drive from a waypoint to the next,
    the drive waits for them."""
    motion: Floats
    """(n, 3) nominal motion of the body origin on the way to the waypoint, body frame: vx, vy
    [m/s] and yaw rate [rad/s]; that of the first waypoint leads on from there. It is also known
    where the rover did not settle."""
    steering_angle: Floats
    """(n, 6) angles of the wheels about the z axes of their links [rad], positive to the left.
    Where the status is STEERING: the angles that the motion asks for."""
    wheel_speed: Floats
    """(n, 6) nominal rates of the wheels [rad/s], without slip, negative where they roll back."""
    distance: Floats
    """(n,) horizontal distance since the first waypoint [m]."""
    wheel_drop: Floats
    """(n, 6) height that a wheel dropped off an edge, here or on the way here [m]."""
    falling: NDArray[np.bool_]
    """(n, 6) True for wheels that roll off an edge here; they need no equilibrium."""
    between: "PathPrediction | None"
    """Poses between waypoints where contacts jump, as on faces and edges; its own `between` is
    None."""
    waypoint: NDArray[np.int64]
    """(n,) index of the waypoint of a row: its own, or the next one for a pose in between."""
    policy: str
    """Torque policy: "equal", "servo" or "optimal"."""
    control_margin: float = 0.0
    """Share of the limits of friction and torque that is left to the controller."""
    bounds: PathBounds | None = None
    """Bounds on the prediction if the map is uncertain, added by `judge_path`; else None."""

    def __post_init__(self) -> None:
        freeze_fields(self)

    def cut(self, waypoints: int) -> "PathPrediction":
        """Return the prediction of the first waypoints of the path and of the way to them."""
        between, bounds = self.between, self.bounds
        if between is not None:
            between = between.select(between.waypoint < waypoints)
        bounds = None if bounds is None else bounds.cut(waypoints)
        return replace(self.select(slice(waypoints)), between=between, bounds=bounds)

    def select(self, rows: Any) -> "PathPrediction":
        """Return the rows of all arrays, without `between` and `bounds`."""
        chosen: dict[str, Any] = {
            name: value[rows]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        return replace(self, **chosen, between=None, bounds=None)
