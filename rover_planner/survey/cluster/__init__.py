# SPDX-License-Identifier: Apache-2.0
"""Dask for a survey: the cluster, its checks, and the run of the chunks."""
