# SPDX-License-Identifier: Apache-2.0
"""Inputs and outputs of the traction controller."""
