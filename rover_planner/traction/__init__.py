# SPDX-License-Identifier: Apache-2.0
"""The traction controller without ROS: computes torques from measurements."""
