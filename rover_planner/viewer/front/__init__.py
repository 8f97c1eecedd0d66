# SPDX-License-Identifier: Apache-2.0
"""The front end: the files that a browser loads, and the channel between it and the program."""
