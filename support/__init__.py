# SPDX-License-Identifier: Apache-2.0
"""Helpers of tests and benchmarks: grounds, reference cases, ROS contexts, a browser."""
