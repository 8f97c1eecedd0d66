# SPDX-License-Identifier: Apache-2.0
"""Prints docs/parameters.md."""

from rover_planner.parameters.document import parameters_document

if __name__ == "__main__":
    print(parameters_document(), end="")
