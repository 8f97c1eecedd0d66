# SPDX-License-Identifier: Apache-2.0
"""Conversions between ROS messages and numpy: pure functions, one file per kind of message."""
