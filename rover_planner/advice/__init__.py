# SPDX-License-Identifier: Apache-2.0
"""Advice: the smallest changes that make a refused path pass."""
