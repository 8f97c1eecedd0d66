# SPDX-License-Identifier: Apache-2.0
"""What the panels say of reasons: lanes of limits, the failure, candidates, before and after."""
