"""Benchmarks: what the product costs, and how it compares with MuJoCo."""
