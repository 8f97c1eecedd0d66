# SPDX-License-Identifier: Apache-2.0
"""Reasons of a verdict: limits along the path, its failure, candidates, before and after."""
