# SPDX-License-Identifier: Apache-2.0
"""Prediction of the rover along a path or over a map: poses in, predictions out."""
