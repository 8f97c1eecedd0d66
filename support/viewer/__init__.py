# SPDX-License-Identifier: Apache-2.0
"""Support of the tests of the page."""
