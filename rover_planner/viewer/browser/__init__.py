# SPDX-License-Identifier: Apache-2.0
"""Access to the browser itself: keys, boxes, the address, and files to send."""
