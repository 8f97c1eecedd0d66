# SPDX-License-Identifier: Apache-2.0
"""Configuration files: location, reading and checks."""
