# SPDX-License-Identifier: Apache-2.0
"""Log lines about what lasts or repeats."""
