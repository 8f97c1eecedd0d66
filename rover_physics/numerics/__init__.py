# SPDX-License-Identifier: Apache-2.0
"""Numerical tools: kernels, records, threads, linear systems, quaternions, read-only arrays."""
