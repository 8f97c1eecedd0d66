# SPDX-License-Identifier: Apache-2.0
"""What the page needs of the browser itself: keys, boxes, the address, and files to send."""
