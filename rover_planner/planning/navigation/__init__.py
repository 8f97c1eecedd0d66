# SPDX-License-Identifier: Apache-2.0
"""Support of a drive without ROS: watch of the path, hazard map, frames."""
