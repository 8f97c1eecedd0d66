# SPDX-License-Identifier: Apache-2.0
"""Pictures: answers on the map, and Figure 4 of the paper."""
