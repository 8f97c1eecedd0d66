# SPDX-License-Identifier: Apache-2.0
"""Why a path is refused and where: limits along it, its failure, candidates, before and after."""
