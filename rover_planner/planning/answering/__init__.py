# SPDX-License-Identifier: Apache-2.0
"""Knowledge of a traverse server, and its answers to questions; without ROS."""
