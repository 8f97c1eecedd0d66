# SPDX-License-Identifier: Apache-2.0
"""What is predicted at a pose, and how much of each limit it uses."""
