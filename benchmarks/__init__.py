# SPDX-License-Identifier: Apache-2.0
"""Benchmarks: run time and memory of the product, and comparisons with MuJoCo."""
