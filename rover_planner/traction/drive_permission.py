# SPDX-License-Identifier: Apache-2.0
"""Whether the rover may drive: enabled by an operator and not stopped by the emergency stop."""


class DrivePermission:
    """Keeps enabling and emergency stop; the stop also takes the enabling away."""

    def __init__(self, enabled: bool):
        """Start enabled or not, without an emergency stop."""
        self.enabled = enabled
        """Whether an operator has enabled the rover."""
        self.emergency_stop = False
        """Whether the emergency stop is pressed."""

    def set_enabled(self, enabled: bool) -> tuple[bool, str]:
        """Enable or disable; return whether that was done, and what holds now."""
        if enabled and self.emergency_stop:
            return False, "not enabled: ~/emergency_stop is true; it must be false first"
        self.enabled = enabled
        return True, "enabled" if enabled else "disabled"

    def take_emergency_stop(self, pressed: bool) -> None:
        """Take the emergency stop: pressed, or released, which does not enable again."""
        self.emergency_stop = pressed
        if pressed:
            self.enabled = False
