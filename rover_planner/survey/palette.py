# SPDX-License-Identifier: Apache-2.0
"""Colours of a survey's classes, in its pictures and on the page."""

from rover_physics.traversability.classification import TRAVERSABILITY_CLASSES
from rover_planner.survey.layers import CLASS_NUMBERS

SOME_HEADINGS = len(CLASS_NUMBERS)
"""Drawn as a class of its own: impassable at some headings, not at others."""
CLASS_LABELS = (*TRAVERSABILITY_CLASSES, "passable at some headings")
"""Names of the drawn classes, by number."""
CLASS_COLOURS = ("#009E73", "#56B4E9", "#E69F00", "#D55E00", "#F0E442")
"""The palette of Okabe and Ito (2008), by number."""
UNKNOWN_LABEL = "unknown ground, edge, or not surveyed"
"""Name of what has no class."""
