# SPDX-License-Identifier: Apache-2.0
"""Maps: loaded, local and kept ones, merged cell by cell, and what is known of their ground."""
