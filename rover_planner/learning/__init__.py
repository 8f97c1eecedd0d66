# SPDX-License-Identifier: Apache-2.0
"""What the wheels tell about the ground they drive on: friction, slip, resistance; without ROS."""
