# SPDX-License-Identifier: Apache-2.0
"""A mesh with a picture on it as a binary glTF file, shown without lights.

Without a graphics card, a matt surface that fills the screen takes most of the time of a picture.
The glTF extension KHR_materials_unlit avoids that. trimesh does not write it, and its meshes are
garbage in circles: a page that draws a ground every few seconds would hold dozens of old ones.
"""

import io
import json
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_physics.numerics.arrays import Floats

UNLIT = "KHR_materials_unlit"
UINT32, FLOAT32 = 5125, 5126
"""Types of numbers in glTF."""


@dataclass(frozen=True, eq=False)
class TexturedMesh:
    """A surface of triangles with a picture on it."""

    vertices: Floats
    """(n, 3) [m], map frame."""
    faces: NDArray[np.intp]
    """(m, 3) indices of vertices."""
    uv: Floats
    """(n, 2) places of the vertices in the picture: columns and rows, 0 to 1."""
    picture: NDArray[np.uint8]
    """(height, width, 3)"""


def write_glb(mesh: TexturedMesh, origin: Floats) -> bytes:
    """Return a mesh about an origin (3,) [m] as a binary glTF file.

    It takes a quarter of a second: most of it to compress the picture.
    """
    from PIL import Image

    vertices = (mesh.vertices - origin).astype("<f4")
    picture = io.BytesIO()
    Image.fromarray(mesh.picture).save(picture, "png")
    parts = [
        mesh.faces.astype("<u4").tobytes(),
        vertices.tobytes(),
        mesh.uv.astype("<f4").tobytes(),
        picture.getvalue(),
    ]
    padded = [part + bytes(-len(part) % 4) for part in parts]
    begins = np.cumsum([0, *map(len, padded)]).tolist()
    corners = {"min": vertices.min(axis=0).tolist(), "max": vertices.max(axis=0).tolist()}
    count = len(vertices)
    content = {
        "asset": {"version": "2.0"},
        "extensionsUsed": [UNLIT],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 1, "TEXCOORD_0": 2},
                        "indices": 0,
                        "material": 0,
                    }
                ]
            }
        ],
        "accessors": [
            _describe_numbers(0, UINT32, mesh.faces.size, "SCALAR"),
            _describe_numbers(1, FLOAT32, count, "VEC3") | corners,
            _describe_numbers(2, FLOAT32, count, "VEC2"),
        ],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
                "extensions": {UNLIT: {}},
            }
        ],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": begin, "byteLength": len(part)}
            for begin, part in zip(begins, parts, strict=False)
        ],
        "buffers": [{"byteLength": begins[-1]}],
    }
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", begins[-1], b"BIN\0") + b"".join(padded)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _describe_numbers(view: int, number: int, count: int, kind: str) -> dict[str, object]:
    return {"bufferView": view, "componentType": number, "count": count, "type": kind}
