# SPDX-License-Identifier: Apache-2.0
"""ROS parts that the nodes share: quality of service, responses, refusals, maps."""
