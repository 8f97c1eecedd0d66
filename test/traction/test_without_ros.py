"""The controller's decisions can be made where ROS is not installed."""

import subprocess
import sys
from pathlib import Path

import pytest

import rover_planner.traction

MODULES = sorted(path.stem for path in Path(rover_planner.traction.__file__).parent.glob("*.py"))


@pytest.mark.parametrize("module", [name for name in MODULES if name != "__init__"])
def test_a_module_of_the_controller_is_imported_without_ros(module):
    code = (
        "import sys\n"
        "for name in ('rclpy', 'sensor_msgs', 'std_msgs', 'diagnostic_msgs'):\n"
        "    sys.modules[name] = None\n"
        f"import rover_planner.traction.{module}\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
