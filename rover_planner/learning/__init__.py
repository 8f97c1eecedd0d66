# SPDX-License-Identifier: Apache-2.0
"""The ground as the wheels feel it: friction, slip, resistance; without ROS."""
