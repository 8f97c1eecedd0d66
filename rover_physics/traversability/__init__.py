# SPDX-License-Identifier: Apache-2.0
"""Assessment of predictions: limits, verdicts, traversability classes, entrapment and reach."""
