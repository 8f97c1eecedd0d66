# SPDX-License-Identifier: Apache-2.0
"""What can be reached on a surveyed map and returned from."""
