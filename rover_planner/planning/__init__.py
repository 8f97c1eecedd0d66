# SPDX-License-Identifier: Apache-2.0
"""Path planning without ROS: candidate paths, their verdicts, and the answers to queries."""
