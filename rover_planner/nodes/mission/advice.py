# SPDX-License-Identifier: Apache-2.0
"""A mission planner takes advice: the first remedy that needs nothing but a path and a policy."""

from collections.abc import Mapping
from typing import Any

OWN_OPTIONS = {"policy", "backward"}
"""Options of a remedy that a mission planner can see to: the server's torque policy, and the
direction, which is that of the path. Arm and payload are others' work."""


def choose_remedy(advice: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the first remedy of ~/advise that needs nobody else, None if there is none."""
    for remedy in advice["remedies"]:
        if not remedy["needs_others"] and set(remedy["options"]) <= OWN_OPTIONS:
            return dict(remedy)
    return None
