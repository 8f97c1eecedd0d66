# SPDX-License-Identifier: Apache-2.0
"""Design studies: sweeps and optimisations of a rover's numbers."""
