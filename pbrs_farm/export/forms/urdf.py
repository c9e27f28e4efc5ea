"""A home as a URDF: one tree of links from `world`, doors and drawers shut. Effects: writes files.

Metres, z up. What stands still hangs at `world` by a fixed joint, loose things by a floating one.
Meshes are OBJ with an MTL, paths are relative to the document.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.joints import JointKind
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.forms.mjcf import body_name
from pbrs_farm.export.home_links import BODY, Link, effort_of
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome, Piece, digest_name
from pbrs_farm.export.obj_files import obj_of_surfaces, png_textures, rgba_of, z_up_points
from pbrs_farm.geometry.convex_parts import hull_faces, slabs
from pbrs_farm.geometry.opened import moved_surface

_WORLD: Final = "world"
_MATERIALS: Final = "materials.mtl"
_MOST_EFFORT, _MOST_SPEED = 100.0, 2.0  # N or N m; m/s or rad/s
_Z_UP: Final = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def write_urdf(home: ExportedHome, folder: Path) -> int:
    """<house id>.urdf, meshes/ and textures/; the number of files."""
    document = _Document(home)
    for name, data in document.files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    ET.indent(document.root)
    text = ET.tostring(document.root, encoding="utf-8", xml_declaration=True)
    (folder / f"{home.house.id}.urdf").write_bytes(text + b"\n")
    return 1 + len(document.files)


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
                self._joint(f"{name}.at", kind, _WORLD, name, place, turn)
                self._shapes(element, piece, link, np.eye(4))
                continue
            # The link's frame is the joint's, and its meshes stand where they are when it is shut.
            shut = joint.motion(0.0)
            shut[:3, 3] -= np.array(joint.point)
            place = z_up_points(np.array([joint.point]))[0]
            kind = "prismatic" if joint.kind is JointKind.PRISMATIC else "revolute"
            row = self._joint(name, kind, body_name(piece, BODY), name, place, np.eye(3))
            ET.SubElement(row, "axis", xyz=_numbers(z_up_points(np.array([joint.axis]))[0]))
            limit = {"lower": f"{joint.lower:.9g}", "upper": f"{joint.upper:.9g}"}
            limit |= {"effort": f"{_MOST_EFFORT:g}", "velocity": f"{_MOST_SPEED:g}"}
            ET.SubElement(row, "limit", limit)
            damping, friction = effort_of(joint)
            ET.SubElement(row, "dynamics", damping=f"{damping:.4g}", friction=f"{friction:.4g}")
            self._shapes(element, piece, link, shut)

    def _joint(
        self, name: str, kind: str, parent: str, child: str, place: F64, turn: F64
    ) -> ET.Element:
        row = ET.SubElement(self.root, "joint", name=name, type=kind)
        ET.SubElement(row, "parent", link=parent)
        ET.SubElement(row, "child", link=child)
        angles = Rotation.from_matrix(turn).as_euler("xyz")
        ET.SubElement(row, "origin", xyz=_numbers(place), rpy=_numbers(angles))
        return row

    def _shapes(self, element: ET.Element, piece: Piece, link: Link, matrix: F64) -> None:
        """matrix: (4, 4) from the piece's frame, y up, to the link's."""
        inertial = ET.SubElement(element, "inertial")
        middle = transform_points(matrix, link.middle[None])
        ET.SubElement(inertial, "origin", xyz=_numbers(z_up_points(middle)[0]))
        ET.SubElement(inertial, "mass", value=f"{link.mass_kg:.6g}")
        turn = _Z_UP @ matrix[:3, :3]
        tensor = turn @ np.diag(link.inertia) @ turn.T
        rows = {
            f"i{'xyz'[a]}{'xyz'[b]}": f"{tensor[a, b]:.6g}" for a in range(3) for b in range(a, 3)
        }
        ET.SubElement(inertial, "inertia", rows)
        for material in sorted({s.material for s in link.surfaces}):
            own = [moved_surface(s, matrix) for s in link.surfaces if s.material == material]
            data = obj_of_surfaces(own, f"material_{material}", _MATERIALS)
            _shape(element, "visual", self._mesh(data))
        is_wall = piece.item.kind.is_structure
        for part in slabs(link.triangles) if is_wall else link.colliders:
            points = z_up_points(transform_points(matrix, part))
            rows_ = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in points]
            rows_ += [f"f {a} {b} {c}" for a, b, c in hull_faces(points) + 1]
            _shape(element, "collision", self._mesh(("\n".join(rows_) + "\n").encode()))

    def _mesh(self, data: bytes) -> str:
        name = f"meshes/{digest_name(data)}.obj"
        self.files[name] = data
        return name


def _shape(element: ET.Element, tag: str, name: str) -> None:
    shape = ET.SubElement(element, tag)
    ET.SubElement(ET.SubElement(shape, "geometry"), "mesh", filename=name)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{float(x):.9g}" for x in values)


FORM = HomeForm(
    "urdf",
    write_urdf,
    "a URDF: `<id>/<id>.urdf`, `meshes/` and `textures/`, metres, z up; doors and drawers have joints and"
    " stand shut, loose things have floating joints",
    remark=COLLIDES,
    up="z",
)
