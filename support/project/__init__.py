# SPDX-License-Identifier: Apache-2.0
"""What tests of the project as a whole share: the checkout, its pages, their commands."""
