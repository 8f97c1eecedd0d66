# SPDX-License-Identifier: Apache-2.0
"""What the front end shows, as plain values made of the state: one part of the page a file."""
