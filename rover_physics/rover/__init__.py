# SPDX-License-Identifier: Apache-2.0
"""Rover: parameters, rover file, linkage and manipulator."""
