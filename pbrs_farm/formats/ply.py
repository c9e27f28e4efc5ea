"""Points with properties as PLY, binary and little-endian; no effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_TYPES: Final = {"float32": "float", "uint8": "uchar", "uint16": "ushort"}  # PLY's names
_FACE: Final = np.dtype([("n", "u1"), ("corners", "<i4", 3)])


def records_of(columns: Mapping[str, NDArray[Any]]) -> NDArray[np.void]:
    """(N,) records of columns (N,): the values of a point side by side without gaps, little-endian."""
    fields = [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
    records = np.empty(len(next(iter(columns.values()))), fields)
    for name, values in columns.items():
        records[name] = values
    return records


def ply_bytes(
    vertices: NDArray[np.void],
    comments: Iterable[str] = (),
    triangles: NDArray[np.integer] | None = None,
) -> bytes:
    """The file of vertices, of `records_of`, and triangles (F, 3); an empty comment is left out."""
    dtype = vertices.dtype
    lines = [
        "ply",
        "format binary_little_endian 1.0",
        *(f"comment {comment}" for comment in comments if comment),
        f"element vertex {len(vertices)}",
        *(f"property {_TYPES[dtype[name].name]} {name}" for name in dtype.names or ()),
    ]
    faces = np.empty(0 if triangles is None else len(triangles), _FACE)
    if triangles is not None:
        lines += [f"element face {len(faces)}", "property list uchar int vertex_indices"]
        faces["n"], faces["corners"] = 3, triangles
    head = "".join(f"{line}\n" for line in [*lines, "end_header"])
    return head.encode() + vertices.tobytes() + faces.tobytes()
