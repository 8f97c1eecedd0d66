# SPDX-License-Identifier: Apache-2.0
"""Exceptions of the package; RoverError is their root."""


class RoverError(Exception):
    """Root of every error that this package raises on purpose."""


class RoverFileError(RoverError):
    """A rover file with a missing, unknown or invalid key; the text names the dotted key."""


class TerrainError(RoverError):
    """A terrain of wrong shape or resolution, without any known cell, or in an unreadable file."""


class PoseError(RoverError):
    """Poses of the wrong shape, or with values that are not finite numbers."""


class ModelError(RoverError):
    """A model argument out of its range, such as an unknown policy or a friction of zero."""


class SoilError(RoverError):
    """A soil file with a wrong key, or a soil that is not in it; the text names soil and key."""
