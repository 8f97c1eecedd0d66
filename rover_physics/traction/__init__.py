# SPDX-License-Identifier: Apache-2.0
"""Traction control: the quadratic program for the torques, and contact angles for it."""
