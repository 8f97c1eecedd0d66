# SPDX-License-Identifier: Apache-2.0
"""The web page that shows a rover on its terrain: what it will do, and why it can or cannot.

`pages` import `scene`, `panel` and `live`; these import `state`, and nothing of each other.
"""
