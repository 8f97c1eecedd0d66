# SPDX-License-Identifier: Apache-2.0
"""Parts of the node /mission_planner."""
