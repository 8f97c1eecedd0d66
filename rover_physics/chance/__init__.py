# SPDX-License-Identifier: Apache-2.0
"""The chance that a path fails, where friction, torques, masses and poses are uncertain."""
