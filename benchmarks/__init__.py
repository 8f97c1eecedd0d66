"""Benchmarks: run time and memory of the product, and comparisons with MuJoCo."""
