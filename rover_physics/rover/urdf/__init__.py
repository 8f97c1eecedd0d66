# SPDX-License-Identifier: Apache-2.0
"""Rovers as URDF: a rover is written as a robot of links and joints, and read from one."""
