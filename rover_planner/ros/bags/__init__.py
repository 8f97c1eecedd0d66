# SPDX-License-Identifier: Apache-2.0
"""Recorded messages: bags are read, their questions answered again, and answers recorded."""
