# SPDX-License-Identifier: Apache-2.0
"""Path planning for rocker-bogie rovers: candidate paths, the command line and the ROS 2 nodes."""
