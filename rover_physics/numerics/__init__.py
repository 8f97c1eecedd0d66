"""Numerical tools: kernels, records, threads, linear systems, quaternions, read-only arrays."""
