# SPDX-License-Identifier: Apache-2.0
"""The controller's decisions can be made where ROS is not installed."""

import subprocess
import sys
from pathlib import Path

import rover_planner.traction


def test_no_module_of_the_controller_needs_ros():
    names = sorted(path.stem for path in Path(rover_planner.traction.__file__).parent.glob("*.py"))
    code = (
        "import importlib, sys\n"
        "for name in ('rclpy', 'sensor_msgs', 'std_msgs', 'diagnostic_msgs'):\n"
        "    sys.modules[name] = None\n"
        f"for name in {names}:\n"
        "    importlib.import_module(f'rover_planner.traction.{name}')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
