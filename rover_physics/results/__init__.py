# SPDX-License-Identifier: Apache-2.0
"""The record of predicted quantities at a pose, and the share of each limit that they use."""
