# SPDX-License-Identifier: Apache-2.0
"""The data of the page: session, trajectory, playback, layers, colours, requests of visitors."""
