"""Dask for a survey: the cluster, its checks, and the run of the chunks."""
