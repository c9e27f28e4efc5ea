"""A home as a URDF: one tree of links from `world`, doors and drawers shut. Effects: writes files.

Metres, z up. What stands still hangs at `world` by a fixed joint, loose things by a floating one.
Meshes are OBJ with an MTL, paths are relative to the document.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.forms.mjcf import body_name
from pbrs_farm.export.home_links import BODY, Link
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome, Piece, digest_name
from pbrs_farm.export.obj_files import obj_of_surfaces, png_textures, rgba_of, z_up_points
from pbrs_farm.export.urdf_links import add_inertial, add_joint, add_mesh, add_moving_joint
from pbrs_farm.geometry.convex_parts import hull_faces, slabs
from pbrs_farm.geometry.opened import moved_surface

_WORLD: Final = "world"
_MATERIALS: Final = "materials.mtl"
_Z_UP: Final = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def write_urdf(home: ExportedHome, folder: Path) -> None:
    """<house id>.urdf, meshes/ and textures/."""
    document = _Document(home)
    for name, data in document.files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    ET.indent(document.root)
    text = ET.tostring(document.root, encoding="utf-8", xml_declaration=True)
    (folder / f"{home.house.id}.urdf").write_bytes(text + b"\n")


class _Document:
    """A home's document, and the files that it names."""

    def __init__(self, home: ExportedHome) -> None:
        self._house = home.house
        self.files: dict[str, bytes] = {}
        self.root = ET.Element("robot", name=home.house.id)
        # What MuJoCo needs to read it, and others pass over: flat meshes have no volume, `mjcf` shows them.
        options = {"strippath": "false", "fusestatic": "false", "discardvisual": "true"}
        ET.SubElement(ET.SubElement(self.root, "mujoco"), "compiler", options)
        ET.SubElement(self.root, "link", name=_WORLD)
        self._write_materials(home)
        for piece in home.pieces:
            if piece.surfaces:
                self._piece(piece)

    def _write_materials(self, home: ExportedHome) -> None:
        used = sorted({s.material for p in home.pieces for s in p.surfaces})
        pictures = png_textures(self._house, used)
        self.files |= {f"textures/{name}": data for name, data in pictures.values()}
        rows = []
        for k in used:
            material = self._house.materials[k]
            r, g, b, opacity = rgba_of(material)
            rows += [f"newmtl material_{k}", f"Kd {r:.5g} {g:.5g} {b:.5g}", f"d {opacity:.5g}"]
            if material.texture_id in pictures:
                rows.append(f"map_Kd ../textures/{pictures[material.texture_id or ''][0]}")
        self.files[f"meshes/{_MATERIALS}"] = ("\n".join(rows) + "\n").encode()

    def _piece(self, piece: Piece) -> None:
        for link in piece.links:
            name = body_name(piece, link.part)
            element = ET.SubElement(self.root, "link", name=name)
            joint = link.joint
            if joint is None:
                kind = "fixed" if piece.is_fixed else "floating"
                turn = _Z_UP @ piece.world_from_local[:3, :3] @ _Z_UP.T
                place = z_up_points(piece.world_from_local[None, :3, 3])[0]
                add_joint(self.root, f"{name}.at", kind, _WORLD, name, place, turn)
                self._shapes(element, piece, link, np.eye(4))
                continue
            shut = add_moving_joint(self.root, name, body_name(piece, BODY), joint, _Z_UP)
            self._shapes(element, piece, link, shut)

    def _shapes(self, element: ET.Element, piece: Piece, link: Link, matrix: F64) -> None:
        """matrix: (4, 4) from the piece's frame, y up, to the link's."""
        add_inertial(element, link, matrix, _Z_UP)
        for material in sorted({s.material for s in link.surfaces}):
            own = [moved_surface(s, matrix) for s in link.surfaces if s.material == material]
            data = obj_of_surfaces(own, f"material_{material}", _MATERIALS)
            add_mesh(element, "visual", self._mesh(data))
        is_wall = piece.item.kind.is_structure
        for part in slabs(link.triangles) if is_wall else link.colliders:
            points = z_up_points(transform_points(matrix, part))
            rows_ = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in points]
            rows_ += [f"f {a} {b} {c}" for a, b, c in hull_faces(points) + 1]
            add_mesh(element, "collision", self._mesh(("\n".join(rows_) + "\n").encode()))

    def _mesh(self, data: bytes) -> str:
        name = f"meshes/{digest_name(data)}.obj"
        self.files[name] = data
        return name


FORM = HomeForm(
    "urdf",
    write_urdf,
    "a URDF: `<id>/<id>.urdf`, `meshes/` and `textures/`, metres, z up; doors and drawers have joints and"
    " stand shut, loose things have floating joints",
    remark=COLLIDES,
    up="z",
)
