# SPDX-License-Identifier: Apache-2.0
"""Launch files without launch, which PyPI has not: what they start."""

import runpy
import sys
from types import ModuleType, SimpleNamespace
from typing import Any
from unittest import mock

from support.project.checkout import TOP

MODULES = {
    "launch": ["LaunchContext", "LaunchDescription"],
    "launch.actions": [
        "DeclareLaunchArgument", "GroupAction", "IncludeLaunchDescription", "OpaqueFunction",
    ],
    "launch.launch_description_sources": ["PythonLaunchDescriptionSource"],
    "launch.substitutions": ["LaunchConfiguration"],
    "launch_ros": [],
    "launch_ros.actions": ["Node", "SetRemap"],
    "launch_ros.parameter_descriptions": ["ParameterValue"],
}  # fmt: skip
"""Classes that launch files import, by module."""


class Kept(SimpleNamespace):
    """An action or substitution that keeps what it was given."""

    def __init__(self, *given: Any, **named: Any):
        super().__init__(given=given, **named)

    def perform(self, context: dict[str, str]) -> str:
        """Return the value of a LaunchConfiguration."""
        return context[self.given[0]]


def describe(name: str) -> tuple[dict[str, Any], list[Any], dict[str, Any]]:
    """Run a launch file; return its arguments with defaults, its other actions and its names."""
    made = {module: ModuleType(module) for module in MODULES}
    for module, classes in MODULES.items():
        vars(made[module]).update({one: type(one, (Kept,), {}) for one in classes})
    with mock.patch.dict(sys.modules, made):
        names = runpy.run_path(str(TOP / "launch" / name))
    actions = names["generate_launch_description"]().given[0]
    declared = [action for action in actions if type(action).__name__ == "DeclareLaunchArgument"]
    assert all(action.description for action in declared)
    defaults = {action.given[0]: action.default_value for action in declared}
    return defaults, [action for action in actions if action not in declared], names


def start_rover(**given: str) -> list[Any]:
    """Return the nodes that rover.launch.py starts with arguments."""
    defaults, (opaque,), _ = describe("rover.launch.py")
    assert given.keys() <= defaults.keys()
    return opaque.function(defaults | given)
