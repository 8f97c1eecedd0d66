# SPDX-License-Identifier: Apache-2.0
"""Wheel contacts, belly clearance, and the pose in which all six wheels touch the ground."""
