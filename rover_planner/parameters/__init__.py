# SPDX-License-Identifier: Apache-2.0
"""Node parameters: one dataclass per node, used for declaration, checks and documentation."""
