"""A home as one GLB: a node an item, its class in extras, lamps as lights. Effects: writes files.

`pbrs-farm run` reads it back: items, classes, boxes, rooms and the flux of lamps are the same.
"""

from __future__ import annotations

from pathlib import Path

from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.home_glb import glb_of_pieces
from pbrs_farm.export.home_pieces import ExportedHome, rooms_json


def write_gltf(home: ExportedHome, folder: Path) -> None:
    """Write <house id>.glb."""
    data = glb_of_pieces(home.house, home.pieces, with_lamps=True, rooms=rooms_json(home.house))
    (folder / f"{home.house.id}.glb").write_bytes(data)


FORM = HomeForm("gltf", write_gltf, "`<id>/<id>.glb`, readable by `pbrs-farm run`")
