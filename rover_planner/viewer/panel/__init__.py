# SPDX-License-Identifier: Apache-2.0
"""The panels beside the scene: tabs, buttons, dashboard and plots."""
