# SPDX-License-Identifier: Apache-2.0
"""Publishers that make messages for those who listen."""
