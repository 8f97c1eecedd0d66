# SPDX-License-Identifier: Apache-2.0
"""Writes results as messages: predictions, verdicts, markers and diagnostics."""
