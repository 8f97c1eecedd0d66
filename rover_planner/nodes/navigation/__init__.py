# SPDX-License-Identifier: Apache-2.0
"""Topics and services for drives: watch of the path, and hazard map."""
