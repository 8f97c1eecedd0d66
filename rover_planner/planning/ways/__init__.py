# SPDX-License-Identifier: Apache-2.0
"""Plans ways between two poses around obstacles, and explains where there is none."""
