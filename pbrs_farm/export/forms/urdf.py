"""A home as a URDF: one tree of links from `world`, doors and drawers shut. Effects: writes files.

Metres, z up. Fixed pieces are joined to `world` by a fixed joint, loose ones by a floating joint.
Meshes are OBJ with an MTL, paths are relative to the document.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np

from pbrs_farm.export.content import write_files
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.home_bodies import Body, Shape, by_material
from pbrs_farm.export.home_files import (
    Z_UP,
    convex_obj,
    digest_name,
    write_shut_remark,
    xml_bytes,
    z_up_points,
    z_up_pose,
)
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome, Piece
from pbrs_farm.export.obj_files import obj_of_surfaces, png_textures, rgba_of
from pbrs_farm.export.urdf_links import add_inertial, add_joint, add_mesh, add_moving_joint

_WORLD: Final = "world"
_MATERIALS: Final = "materials.mtl"


def write_urdf(home: ExportedHome, folder: Path) -> None:
    """Write <house id>.urdf, meshes/ and textures/."""
    document = _Document(home)
    write_files(folder, [document.files, {f"{home.house.id}.urdf": xml_bytes(document.root)}])
    write_shut_remark(home, folder)


class _Document:
    """A home's document, and the files that it names."""

    def __init__(self, home: ExportedHome) -> None:
        self.files: dict[str, bytes] = {}
        self.root = ET.Element("robot", name=home.house.id)
        # For MuJoCo, ignored by others: flat meshes have no volume, and `mjcf` shows them.
        options = {"strippath": "false", "fusestatic": "false", "discardvisual": "true"}
        ET.SubElement(ET.SubElement(self.root, "mujoco"), "compiler", options)
        ET.SubElement(self.root, "link", name=_WORLD)
        self._write_materials(home)
        for piece in home.pieces:
            if piece.surfaces:
                self._piece(piece)

    def _write_materials(self, home: ExportedHome) -> None:
        pictures = png_textures(home.house, home.materials)
        self.files |= {f"textures/{name}": data for name, data in pictures.values()}
        rows = []
        for k in home.materials:
            material = home.house.materials[k]
            r, g, b, opacity = rgba_of(material)
            rows += [f"newmtl material_{k}", f"Kd {r:.5g} {g:.5g} {b:.5g}", f"d {opacity:.5g}"]
            if material.texture_id in pictures:
                rows.append(f"map_Kd ../textures/{pictures[material.texture_id or ''][0]}")
        self.files[f"meshes/{_MATERIALS}"] = ("\n".join(rows) + "\n").encode()

    def _piece(self, piece: Piece) -> None:
        for body in piece.bodies:
            element = ET.SubElement(self.root, "link", name=body.name)
            frame = np.eye(4)
            if body.joint is None:
                kind = "fixed" if piece.is_fixed else "floating"
                pose = z_up_pose(piece.world_from_local)
                add_joint(self.root, f"{body.name}.at", kind, _WORLD, body.name, *pose)
            else:
                frame = add_moving_joint(self.root, body.name, piece.name, body.joint, Z_UP)
            self._shapes(element, body, body.shape(frame))

    def _shapes(self, element: ET.Element, body: Body, shape: Shape) -> None:
        add_inertial(element, body.mass_kg, shape, Z_UP)
        for material, surfaces in by_material(shape.surfaces):
            data = obj_of_surfaces(surfaces, f"material_{material}", _MATERIALS)
            add_mesh(element, "visual", self._mesh(data))
        for part in shape.colliders:
            add_mesh(element, "collision", self._mesh(convex_obj(z_up_points(part))))

    def _mesh(self, data: bytes) -> str:
        name = f"meshes/{digest_name(data)}.obj"
        self.files[name] = data
        return name


FORM = HomeForm(
    "urdf",
    write_urdf,
    "a URDF: `<id>/<id>.urdf`, `meshes/` and `textures/`, metres, z up; doors and drawers have joints and"
    " are closed, loose items have floating joints",
    remark=COLLIDES,
    up="z",
)
