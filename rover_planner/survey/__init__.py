# SPDX-License-Identifier: Apache-2.0
"""Surveys of whole maps: where a rover can stand and drive, and what it can reach."""
