# SPDX-License-Identifier: Apache-2.0
"""Forces between wheels and ground: equilibrium, torques, soil, tip-over measures."""
