"""ROS parts that the nodes share: quality of service, deferred work, refusals, maps."""
