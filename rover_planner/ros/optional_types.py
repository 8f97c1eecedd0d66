# SPDX-License-Identifier: Apache-2.0
"""Types of messages, services and actions of packages that a robot may lack."""

import importlib
from functools import cache


@cache
def find_type(name: str) -> type | None:
    """Return a type such as grid_map_msgs.msg:GridMap; None where its package is missing."""
    module, _, kind = name.partition(":")
    try:
        found: type = getattr(importlib.import_module(module), kind)
    except ImportError:
        return None
    return found
