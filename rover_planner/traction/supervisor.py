# SPDX-License-Identifier: Apache-2.0
"""Decides whether the rover drives or rests, and what its wheels do at rest."""

import math
from dataclasses import dataclass

import numpy as np

from rover_physics.names import WHEEL_COUNT
from rover_physics.numerics.arrays import Floats
from rover_planner.parameters.traction_controller import BRAKE, HOLD
from rover_planner.traction.drive_permission import DrivePermission
from rover_planner.traction.hold import HoldServo
from rover_planner.traction.settings import TractionSettings
from rover_planner.traction.stall_watch import StallWatch
from rover_planner.traction.traction_service import TractionService
from rover_planner.traction.traction_update import TractionUpdate

DISABLED, EMERGENCY_STOP, FAULT = "disabled", "emergency_stop", "fault"
STALLED, STANDSTILL, DRIVING = "stalled", "standstill", "driving"
STATES = (DISABLED, EMERGENCY_STOP, FAULT, STALLED, STANDSTILL, DRIVING)
"""What the rover does; it drives in the last state only."""
STANDSTILL_DELAY = 0.5
"""Time for which the loops bring the rover to a stop before the rest policy takes over [s]."""

RECOVERY_TIME = 0.2
"""Time for which everything must be right before the rover drives again [s]."""


@dataclass(frozen=True, eq=False)
class TractionCommand:
    """What the node commands after one update."""

    torques: Floats
    """(6,) torques, wheel order [N m]."""
    brake: bool
    """Whether the brake is to be applied."""
    state: str
    """One of STATES."""
    update: TractionUpdate
    """The update of the torque allocation; its fault is the reason not to drive, if any."""
    expiry: float
    """Time at which the first input that the torques need becomes stale [s]."""


class TractionSupervisor:
    """Passes on the torques of a TractionService while the rover may drive, else those of rest."""

    def __init__(self, settings: TractionSettings, enabled: bool):
        """Start at rest; `enabled` is the permission to drive once all inputs are there."""
        self.service = TractionService(settings)
        """Keeps measurements and allocates torques."""
        self.permission = DrivePermission(enabled)
        """Enabling and emergency stop."""
        self._hold = HoldServo(settings, self.service.weight)
        self._latch = FaultLatch()
        self._stall = StallWatch()
        self._tripped = ""
        self._last_time: float | None = None
        self._standing = 0.0
        self._held = False
        self._rest_torques: Floats | None = None

    def configure(self, settings: TractionSettings) -> None:
        """Take new settings between two updates; torques go on from the last ones."""
        self.service.settings = settings
        self._hold.configure(settings, self.service.weight)

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
        fault = self._latch.update(fault, now)
        state = self._find_state(fault, duration)
        if state != DRIVING:
            return self._rest(state, fault, now, duration)
        if self._rest_torques is not None:
            self.service.start_from(self._rest_torques)
            self._rest_torques = None
        self._held = False
        update = self.service.update(now)
        if update.fault:
            self._latch.update(update.fault, now)
            return self._rest(FAULT, update.fault, now, duration)
        return TractionCommand(update.torques, False, DRIVING, update, self.service.expiry)

    def fail(self, fault: str) -> TractionCommand:
        """Return zero torques and the brake, after an internal error."""
        self._held, self._rest_torques = False, None
        self.trip(fault)
        update = self.service.rest(fault)
        return TractionCommand(update.torques, True, FAULT, update, float("inf"))

    def _find_state(self, fault: str, duration: float) -> str:
        """Return the state; the first of STATES that applies."""
        if self.permission.emergency_stop:
            self._stall.reset()
            return EMERGENCY_STOP
        if not self.permission.enabled:
            self._stall.reset()
            return DISABLED
        if fault:
            return FAULT
        if self._is_stalled(duration):
            return STALLED
        return STANDSTILL if self._is_standing(duration) else DRIVING

    def _is_stalled(self, duration: float) -> bool:
        if self.service.climbs:
            self._stall.reset_time()
        stall_time = self.service.settings.stall_time
        rates, wanted = self.service.wheel_rates, self.service.wanted_rates
        return self._stall.update(rates, wanted, duration, stall_time)

    def _is_standing(self, duration: float) -> bool:
        """Return whether the commanded speeds have been zero for STANDSTILL_DELAY."""
        self._standing = 0.0 if any(self.service.wanted) else self._standing + duration
        return self._standing >= STANDSTILL_DELAY

    def _rest(self, state: str, fault: str, now: float, duration: float) -> TractionCommand:
        """Return the command of a rover at rest, by the policy of the settings."""
        settings = self.service.settings
        update = self.service.rest(fault)
        torques, expiry = np.zeros(WHEEL_COUNT), float("inf")
        timeout = settings.timeouts.joint_states
        blind = now - self.service.wheel_time > timeout
        brake = settings.rest_policy == BRAKE or (settings.rest_policy == HOLD and blind)
        if settings.rest_policy == HOLD and not blind:
            torques, expiry = self._hold_wheels(duration), self.service.wheel_time + timeout
        else:
            self._held = False
        self._rest_torques = torques
        return TractionCommand(torques, brake, state, update, expiry)

    def _hold_wheels(self, duration: float) -> Floats:
        if not self._held:
            self._hold.start(self.service.pitch)
        self._held = True
        return self._hold.update(self.service.wheel_rates, duration)


class FaultLatch:
    """A fault counts at once and passes RECOVERY_TIME after its cause."""

    def __init__(self) -> None:
        """Start without a fault."""
        self._fault, self._end = "", -math.inf

    def update(self, fault: str, now: float) -> str:
        """Return the fault that counts at time `now` [s]; empty if there is none.

        Args:
            fault: What is wrong now; empty if nothing is.
            now: Monotonic time [s].
        """
        if fault:
            self._fault, self._end = fault, now + RECOVERY_TIME
        elif now >= self._end:
            self._fault = ""
        return self._fault
