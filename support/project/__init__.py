# SPDX-License-Identifier: Apache-2.0
"""Shared parts of tests of the whole project: the checkout, its pages, their commands."""
