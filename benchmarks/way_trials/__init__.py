"""Parts of `benchmarks.ways`: grounds and pairs, and what the searches are compared with."""
