# SPDX-License-Identifier: Apache-2.0
"""What a traverse server knows, and its answers to questions; without ROS."""
