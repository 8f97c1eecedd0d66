"""Helpers of tests and benchmarks: grounds, reference cases, ROS contexts, a browser."""
