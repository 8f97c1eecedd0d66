# SPDX-License-Identifier: Apache-2.0
"""The rovers that come with the package; all tests of a process share them."""

from rover_physics import load_rover

LSR1, M2020 = load_rover("lsr1"), load_rover("m2020")
