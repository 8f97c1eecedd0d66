# SPDX-License-Identifier: Apache-2.0
"""The four nodes and their topics."""
