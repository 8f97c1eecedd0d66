# SPDX-License-Identifier: Apache-2.0
"""Decides whether the rover drives or rests, and what its wheels do at rest.

The policies of rest:

- hold: each wheel has a PI servo to a rate of zero. It starts from the torques that balance the
  weight along the slope, so the rover does not roll first. It needs fresh wheel rates; without
  them the torques are zero and the brake is applied.
- brake: zero torques, the brake is applied.
- coast: zero torques, the brake is released. On a slope the rover rolls.
"""

import math
from dataclasses import replace

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.parameters.traction_controller import BRAKE, HOLD
from rover_planner.traction.loops import StallWatch, WheelServos
from rover_planner.traction.settings import TractionSettings
from rover_planner.traction.traction_service import (
    DISABLED,
    DRIVING,
    EMERGENCY_STOP,
    FAULT,
    MAX_STEP,
    STALLED,
    STANDSTILL,
    TractionCommand,
    TractionService,
)

STANDSTILL_DELAY = 0.5
"""Time for which the loops bring the rover to a stop before the rest policy takes over [s]."""
RECOVERY_TIME = 0.2
"""Time for which everything must be right before the rover drives again [s]."""
HOLD_RATE_GAIN = 10.0
"""Angular deceleration per wheel rate of the hold servos [1/s]."""
HOLD_ANGLE_GAIN = 25.0
"""Angular deceleration per angle turned of the hold servos [1/s^2]."""


class TractionSupervisor:
    """Passes on the torques of a TractionService while the rover may drive, else those of rest."""

    def __init__(self, settings: TractionSettings, enabled: bool):
        """Start at rest; `enabled` is the permission to drive once all inputs are there."""
        self.service = TractionService(settings)
        """Keeps measurements and allocates torques."""
        self.enabled = enabled
        """True if an operator has enabled the rover, and no emergency stop was pressed since."""
        self.emergency_stop = False
        """True if the emergency stop is pressed."""
        self._hold: WheelServos | None = None
        """The servos that hold the wheels now; None if none do."""
        self._fault, self._fault_end = "", -math.inf
        self._stall = StallWatch()
        self._tripped = ""
        self._last_time: float | None = None
        self._standing = 0.0
        self._rest_torques: Floats | None = None

    def configure(self, settings: TractionSettings) -> None:
        """Take new settings between two updates; torques go on from the last ones."""
        self.service.settings = settings
        if self._hold is not None:
            self._hold = self._create_hold(self._hold.integral)

    def _create_hold(self, torques: Floats) -> WheelServos:
        """Return servos that hold the wheels at rest and go on from torques (6,) [N m]."""
        rover, weight = self.service.settings.rover, self.service.weight
        inertia = weight / rover.gravity * rover.wheel.radius**2 / WHEEL_COUNT
        most = self.service.settings.max_torque
        servos = WheelServos(HOLD_RATE_GAIN * inertia, HOLD_ANGLE_GAIN * inertia, most)
        servos.start(torques)
        return servos

    def set_enabled(self, enabled: bool) -> tuple[bool, str]:
        """Enable or disable; return whether that was done, and what holds now."""
        if enabled and self.emergency_stop:
            return False, "not enabled: ~/emergency_stop is true; it must be false first"
        self.enabled = enabled
        return True, "enabled" if enabled else "disabled"

    def take_emergency_stop(self, pressed: bool) -> None:
        """Take the emergency stop: pressed, or released, which does not enable again."""
        self.emergency_stop = pressed
        self.enabled = self.enabled and not pressed

    def trip(self, fault: str) -> None:
        """Take a fault that was found elsewhere into the next update."""
        self._tripped = fault

    def update(self, now: float, clock_fault: str = "") -> TractionCommand:
        """Return the command for time `now` [s], on the clock of the inputs.

        Args:
            now: Monotonic time [s].
            clock_fault: What is wrong with the clock of the stamps; empty if nothing is.
        """
        duration = 0.0 if self._last_time is None else max(now - self._last_time, 0.0)
        self._last_time = now
        fault = self._tripped or clock_fault or self.service.find_fault(now)
        self._tripped = ""
        fault = self._latch(fault, now)
        state = self._find_state(fault, duration)
        if state != DRIVING:
            return self._rest(state, fault, now, duration)
        if self._rest_torques is not None:
            self.service.start_from(self._rest_torques)
            self._rest_torques = None
        self._hold = None
        command = self.service.drive(now)
        if command.fault:
            self._latch(command.fault, now)
            return self._rest(FAULT, command.fault, now, duration)
        return command

    def fail(self, fault: str) -> TractionCommand:
        """Return zero torques and the brake, after an internal error."""
        self._hold = self._rest_torques = None
        self.trip(fault)
        return replace(self.service.rest(fault), brake=True)

    def _latch(self, fault: str, now: float) -> str:
        """Return the fault that counts: at once, and until RECOVERY_TIME after its cause."""
        if fault:
            self._fault, self._fault_end = fault, now + RECOVERY_TIME
        elif now >= self._fault_end:
            self._fault = ""
        return self._fault

    def _find_state(self, fault: str, duration: float) -> str:
        """Return the state; the first of STATES that applies."""
        if not self.enabled:
            self._stall = StallWatch()
            return EMERGENCY_STOP if self.emergency_stop else DISABLED
        if fault:
            return FAULT
        if self._is_stalled(duration):
            return STALLED
        return STANDSTILL if self._is_standing(duration) else DRIVING

    def _is_stalled(self, duration: float) -> bool:
        if not any(self.service.wanted):
            self._stall = StallWatch()
            return False
        if self.service.climbs:
            self._stall.reset_time()
        stall_time = self.service.settings.parameters.stall_time
        rates, wanted = self.service.joints.wheel_rates, self.service.wanted_rates
        return self._stall.update(rates, wanted, duration, stall_time)

    def _is_standing(self, duration: float) -> bool:
        """Return whether the commanded speeds have been zero for STANDSTILL_DELAY."""
        self._standing = 0.0 if any(self.service.wanted) else self._standing + duration
        return self._standing >= STANDSTILL_DELAY

    def _rest(self, state: str, fault: str, now: float, duration: float) -> TractionCommand:
        """Return the command of a rover at rest, by the policy of the settings."""
        parameters = self.service.settings.parameters
        self.service.rest(fault)
        torques, expiry = np.zeros(WHEEL_COUNT), math.inf
        timeout, policy = parameters.joint_states_timeout, parameters.rest_policy
        joints_unknown = now - self.service.joints.wheel_time > timeout
        brake = policy == BRAKE or (policy == HOLD and joints_unknown)
        if policy == HOLD and not joints_unknown:
            torques, expiry = self._hold_wheels(duration), self.service.joints.wheel_time + timeout
        else:
            self._hold = None
        self._rest_torques = torques
        return TractionCommand(torques, fault, state=state, brake=brake, expiry=expiry)

    def _hold_wheels(self, duration: float) -> Floats:
        """Return the torques (6,) [N m] that stop and hold the wheels."""
        service, most = self.service, self.service.settings.max_torque
        if self._hold is None:
            radius = service.settings.rover.wheel.radius
            needed = -(service.weight * radius / WHEEL_COUNT) * math.sin(service.pitch)
            self._hold = self._create_hold(np.full(WHEEL_COUNT, needed))
        torques = self._hold.update(-service.joints.wheel_rates, min(duration, MAX_STEP))
        return np.minimum(np.maximum(torques, -most), most)
