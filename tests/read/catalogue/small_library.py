"""A tiny furniture library built in code: properties and models in a zip."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

# A wedge 2 wide, 1 deep, 1 high whose tall side is at the back (-z); metres do not matter.
WEDGE_OBJ = b"""mtllib wedge.mtl
v -1 0 0.5
v 1 0 0.5
v 1 0 -0.5
v -1 0 -0.5
v -1 1 -0.5
v 1 1 -0.5
usemtl wood
f 1 2 6 5
f 2 3 6
f 3 4 5 6
f 4 1 5
f 4 3 2 1
"""
WEDGE_MTL = b"newmtl wood\nKd 0.5 0.3 0.1\n"
HEAD = {"name": "Small", "license": "Creative Commons Attribution 3.0 license"}


def entry(
    name: str, size_cm: tuple[float, float, float] = (80, 40, 90), **more: str
) -> dict[str, str]:
    """The properties of one piece of the wedge."""
    width, depth, height = size_cm
    return {
        "id": f"Small#{name.lower().replace(' ', '-')}", "name": name, "category": "Living room",
        "model": "/wedge/wedge.obj", "width": f"{width}", "depth": f"{depth}",
        "height": f"{height}", "creator": "Someone",
    } | more  # fmt: skip


def library_bytes(
    entries: list[dict[str, str]],
    contents: Mapping[str, bytes] | None = None,
    *,
    head: Mapping[str, str] = HEAD,
    catalogue: str = "PluginFurnitureCatalog.properties",
) -> bytes:
    """A .sh3f of these entries; contents replace or add to the wedge's files."""
    lines = [f"{key}={value}" for key, value in head.items()]
    for number, row in enumerate(entries, 1):
        lines += [f"{key}#{number}={value}" for key, value in row.items()]
    members = {"wedge/wedge.obj": WEDGE_OBJ, "wedge/wedge.mtl": WEDGE_MTL} | dict(contents or {})
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr(catalogue, "\n".join(lines))
        for name, data in members.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def library(folder: Path, entries: list[dict[str, str]], **more: object) -> Path:
    """The library as a file."""
    path = folder / "Small.sh3f"
    path.write_bytes(library_bytes(entries, **more))  # type: ignore[arg-type]
    return path
