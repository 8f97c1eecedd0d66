"""What tests and benchmarks share: grounds, reference cases, ROS for tests, a browser."""
