# SPDX-License-Identifier: Apache-2.0
"""A simulated rover on a terrain with the interfaces of a real rover."""
