# SPDX-License-Identifier: Apache-2.0
"""The demo: a server, a mission planner that queries it, a table and a picture."""
