# SPDX-License-Identifier: Apache-2.0
"""The web page that shows a rover on its terrain: what it will do, and why it can or cannot.

`pages` bring the state (`state`, `live`) into viser's scene (`scene`) and, as plain values
(`documents`), over a JSON channel to the front end (`front`).
"""
