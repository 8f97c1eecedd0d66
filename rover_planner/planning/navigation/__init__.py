# SPDX-License-Identifier: Apache-2.0
"""What a drive needs without ROS: watch of the path, hazard map, frames."""
