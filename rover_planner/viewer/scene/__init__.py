# SPDX-License-Identifier: Apache-2.0
"""The 3-D scene: ground, rover, forces, and the paths over the ground."""
