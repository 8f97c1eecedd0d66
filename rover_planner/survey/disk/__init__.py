# SPDX-License-Identifier: Apache-2.0
"""What a survey keeps on the disk: files that last, layers that are read by parts."""
