"""A home as a world of Gazebo, SDF 1.9. Effects: writes files.

Metres, z up, gravity; a static model for the building, a model a thing with visual, convex collision
parts, mass and lamps. Meshes stay y up, as glTF asks and Gazebo reads them: their poses turn them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.home_glb import glb_of_pieces
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome, Lamp, Piece, digest_name
from pbrs_farm.geometry.convex_parts import hull_faces

# (x, y, z) with y up -> (x, -z, y) with z up.
_Z_UP: Final = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
_GRAVITY: Final = (0.0, 0.0, -9.81)
_BRIGHT_CD: Final = 100.0  # is intensity 1: Gazebo's pictures have no exposure
_FAINT: Final = 0.01  # a light ends where this is left of intensity 1 at a metre
_LEAST_RANGE_M: Final = 1.0
_BUILDING: Final = "building"
_RESERVED: Final = (_BUILDING, "world")


def write_sdf(home: ExportedHome, folder: Path) -> int:
    """<house id>.sdf and meshes/; the number of files."""
    world = _World(home)
    (folder / "meshes").mkdir(exist_ok=True)
    for name, data in world.meshes.items():
        (folder / name).write_bytes(data)
    text = ET.tostring(world.document, encoding="utf-8", xml_declaration=True)
    (folder / f"{home.house.id}.sdf").write_bytes(text + b"\n")
    return 1 + len(world.meshes)


class _World:
    """A home's document, and the meshes that it names: path below the document's folder -> bytes."""

    def __init__(self, home: ExportedHome) -> None:
        self._home = home
        self.meshes: dict[str, bytes] = {}
        self.document = ET.Element("sdf", version="1.9")
        world = ET.SubElement(self.document, "world", name=home.house.id)
        _put(world, "gravity", *_GRAVITY)
        self._building(world)
        for piece, name in zip(home.things, _model_names(home.things), strict=True):
            self._thing(world, piece, name)
        ET.indent(self.document)

    def _building(self, world: ET.Element) -> None:
        pieces = self._home.building
        model = ET.SubElement(world, "model", name=_BUILDING)
        ET.SubElement(model, "static").text = "true"
        link = ET.SubElement(model, "link", name="link")
        if any(piece.surfaces for piece in pieces):
            data = glb_of_pieces(self._home.house, pieces, with_lamps=False)
            uri = self._mesh(_BUILDING, ".glb", data)
            _shape(link, "visual", "visual", uri)
            _shape(link, "collision", "collision", uri)
        lamps = [lamp for piece in pieces for lamp in piece.lamps]
        _lights(link, _BUILDING, lamps, np.eye(4))

    def _thing(self, world: ET.Element, piece: Piece, name: str) -> None:
        model = ET.SubElement(world, "model", name=name)
        world_from_model = _Z_UP @ piece.world_from_local @ _Z_UP.T
        _put_pose(model, world_from_model)
        ET.SubElement(model, "static").text = "true" if piece.is_fixed else "false"
        link = ET.SubElement(model, "link", name="link")
        _inertial(link, piece)
        word = piece.class_name.replace(" ", "_")
        if piece.surfaces:
            house = self._home.house
            data = glb_of_pieces(house, [piece], with_lamps=False, in_place=False)
            _shape(link, "visual", "visual", self._mesh(word, ".glb", data))
        for k, part in enumerate(piece.colliders):
            data = _obj(part)
            _shape(link, "collision", f"collision_{k}", self._mesh(f"{word}_part", ".obj", data))
        _lights(link, name, piece.lamps, np.asarray(np.linalg.inv(world_from_model), np.float64))

    def _mesh(self, word: str, suffix: str, data: bytes) -> str:
        """The URI of a mesh; equal ones are one file."""
        name = f"meshes/{word}_{digest_name(data)}{suffix}"
        self.meshes[name] = data
        return name


def _model_names(pieces: Iterable[Piece]) -> list[str]:
    """The pieces' names, but none that SDF or the building has."""
    taken, found = set(_RESERVED), []
    for piece in pieces:
        name = piece.name
        while name in taken:
            name += "_thing"
        taken.add(name)
        found.append(name)
    return found


def _put(parent: ET.Element, tag: str, *numbers: float) -> ET.Element:
    child = ET.SubElement(parent, tag)
    child.text = " ".join(f"{float(x):.9g}" for x in numbers)
    return child


def _put_pose(parent: ET.Element, b_from_a: F64) -> None:
    turn = Rotation.from_matrix(b_from_a[:3, :3]).as_quat()
    child = _put(parent, "pose", *b_from_a[:3, 3], *turn)
    child.set("rotation_format", "quat_xyzw")


def _shape(link: ET.Element, tag: str, name: str, uri: str) -> None:
    """A visual or a collision: a mesh with y up, turned to z up."""
    shape = ET.SubElement(link, tag, name=name)
    _put_pose(shape, _Z_UP)
    mesh = ET.SubElement(ET.SubElement(shape, "geometry"), "mesh")
    ET.SubElement(mesh, "uri").text = uri


def _inertial(link: ET.Element, piece: Piece) -> None:
    """Mass in the middle of its box, which stands on the link's origin."""
    inertial = ET.SubElement(link, "inertial")
    _put(inertial, "pose", 0, 0, piece.size[1] / 2, 0, 0, 0)
    _put(inertial, "mass", piece.mass_kg)
    inertia = ET.SubElement(inertial, "inertia")
    along_x, along_y, along_z = piece.inertia
    rows = {"ixx": along_x, "ixy": 0, "ixz": 0, "iyy": along_z, "iyz": 0, "izz": along_y}
    for tag, value in rows.items():
        _put(inertia, tag, value)


def _lights(link: ET.Element, name: str, lamps: Sequence[Lamp], link_from_world: F64) -> None:
    """Lamps in their link, so that they move with it. They cast no shadow: a bulb would hide them."""
    link_from_home = link_from_world @ _Z_UP
    for k, lamp in enumerate(lamps):
        kind = "spot" if lamp.spot else "point"
        light = ET.SubElement(link, "light", name=f"{name}_light_{k}", type=kind)
        frame = np.eye(4)
        frame[:3, 3] = (link_from_home @ [*lamp.position, 1])[:3]
        _put_pose(light, frame)
        ET.SubElement(light, "cast_shadows").text = "false"
        intensity = lamp.candela / _BRIGHT_CD
        _put(light, "intensity", intensity)
        _put(light, "diffuse", *lamp.rgb_linear, 1)
        _put(light, "specular", *lamp.rgb_linear, 1)
        attenuation = ET.SubElement(light, "attenuation")
        _put(attenuation, "range", max(np.sqrt(intensity / _FAINT), _LEAST_RANGE_M))
        for tag, value in (("constant", 0.0), ("linear", 0.0), ("quadratic", 1.0)):
            _put(attenuation, tag, value)
        if lamp.spot:
            direction, half_angle = lamp.spot
            _put(light, "direction", *(link_from_home[:3, :3] @ direction))
            spot = ET.SubElement(light, "spot")
            # Gazebo has a cone's whole angle, and cones end at a half space.
            for tag, value in (("inner_angle", 0.0), ("outer_angle", min(2 * half_angle, np.pi))):
                _put(spot, tag, value)
            _put(spot, "falloff", 1)


def _obj(part: F64) -> bytes:
    """A convex part as a Wavefront OBJ."""
    rows = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in part]
    rows += [f"f {a} {b} {c}" for a, b, c in hull_faces(part) + 1]
    return ("\n".join(rows) + "\n").encode()


FORM = HomeForm(
    "sdf",
    write_sdf,
    "a world of Gazebo, SDF 1.9: `<id>/<id>.sdf` and `meshes/`, metres, z up, gravity",
    remark=COLLIDES,
)
