# SPDX-License-Identifier: Apache-2.0
"""Parts shared by all programs: exit codes, command-line arguments, missing libraries."""
