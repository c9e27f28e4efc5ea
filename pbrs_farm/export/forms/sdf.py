"""A home as a world of Gazebo, SDF 1.9. Effects: writes files.

Metres, z up, gravity; a static model for the building, a model a thing with visual, convex collision
parts, mass and lamps. Meshes stay y up, as glTF asks and Gazebo reads them: their poses turn them.
What opens has a link and a joint for each part, and stands shut: a world tells joints no state.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.house import Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.home_glb import glb_of_pieces
from pbrs_farm.export.home_links import BODY, effort_of
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome, Lamp, Piece, digest_name
from pbrs_farm.geometry.convex_parts import hull_faces
from pbrs_farm.geometry.opened import moved_surface

# (x, y, z) with y up -> (x, -z, y) with z up.
_Z_UP: Final = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
_GRAVITY: Final = (0.0, 0.0, -9.81)
_BRIGHT_CD: Final = 100.0  # is intensity 1: Gazebo's pictures have no exposure
_FAINT: Final = 0.01  # a light ends where this is left of intensity 1 at a metre
_LEAST_RANGE_M: Final = 1.0
_BUILDING: Final = "building"
# What stands still meets all but the parts that open: these meet loose things alone.
_STILL, _MOVING = 1, 2
_RESERVED: Final = (_BUILDING, "world")


def write_sdf(home: ExportedHome, folder: Path) -> None:
    """<house id>.sdf and meshes/."""
    world = _World(home)
    (folder / "meshes").mkdir(exist_ok=True)
    for name, data in world.meshes.items():
        (folder / name).write_bytes(data)
    text = ET.tostring(world.document, encoding="utf-8", xml_declaration=True)
    (folder / f"{home.house.id}.sdf").write_bytes(text + b"\n")


class _World:
    """A home's document, and the meshes that it names: path below the document's folder -> bytes."""

    def __init__(self, home: ExportedHome) -> None:
        self._home = home
        self.meshes: dict[str, bytes] = {}
        self.document = ET.Element("sdf", version="1.9")
        world = ET.SubElement(self.document, "world", name=home.house.id)
        _put(world, "gravity", *_GRAVITY)
        self._building(world)
        doors = tuple(piece for piece in home.building if len(piece.links) > 1)
        pieces = (*doors, *home.things)
        for piece, name in zip(pieces, _model_names(pieces), strict=True):
            if len(piece.links) > 1:
                self._opening(world, piece, name)
            else:
                self._thing(world, piece, name)
        ET.indent(self.document)

    def _building(self, world: ET.Element) -> None:
        pieces = [piece for piece in self._home.building if len(piece.links) == 1]
        model = ET.SubElement(world, "model", name=_BUILDING)
        ET.SubElement(model, "static").text = "true"
        link = ET.SubElement(model, "link", name="link")
        if any(piece.surfaces for piece in pieces):
            data = glb_of_pieces(self._home.house, pieces, with_lamps=False)
            uri = self._mesh(_BUILDING, ".glb", data)
            _shape(link, "visual", "visual", uri)
            _shape(link, "collision", "collision", uri, _STILL)
        lamps = [lamp for piece in pieces for lamp in piece.lamps]
        _lights(link, _BUILDING, lamps, np.eye(4))

    def _thing(self, world: ET.Element, piece: Piece, name: str) -> None:
        model, world_from_model = _model(world, piece, name)
        ET.SubElement(model, "static").text = "true" if piece.is_fixed else "false"
        link = ET.SubElement(model, "link", name="link")
        _inertial(link, np.array([0, piece.size[1] / 2, 0]), piece.mass_kg, np.diag(piece.inertia))
        mask = _STILL if piece.is_fixed else None
        self._shapes(link, piece, piece.surfaces, piece.colliders, mask)
        _lights(link, name, piece.lamps, np.asarray(np.linalg.inv(world_from_model), np.float64))

    def _opening(self, world: ET.Element, piece: Piece, name: str) -> None:
        """A model whose body stands still, where the piece does, by a joint to the world."""
        model, world_from_model = _model(world, piece, name)
        ET.SubElement(model, "static").text = "false"
        for part in piece.links:
            link = ET.SubElement(model, "link", name=link_name(part.part))
            shut = np.eye(4) if part.joint is None else part.joint.motion(0.0)
            tensor = shut[:3, :3] @ np.diag(part.inertia) @ shut[:3, :3].T
            _inertial(link, transform_points(shut, part.middle[None])[0], part.mass_kg, tensor)
            mask = None if not piece.is_fixed else _STILL if part.joint is None else _MOVING
            surfaces = tuple(moved_surface(s, shut) for s in part.surfaces)
            colliders = tuple(transform_points(shut, c) for c in part.colliders)
            self._shapes(link, piece, surfaces, colliders, mask)
            if part.joint is not None:
                ET.SubElement(link, "gravity").text = "false"  # counterbalanced
                _joint(model, link_name(part.part), part.joint)
                continue
            inverse = np.asarray(np.linalg.inv(world_from_model), np.float64)
            _lights(link, name, piece.lamps, inverse)
            if piece.is_fixed:
                row = ET.SubElement(model, "joint", name="at", type="fixed")
                ET.SubElement(row, "parent").text = "world"
                ET.SubElement(row, "child").text = link_name(BODY)

    def _shapes(
        self, link: ET.Element, piece: Piece, surfaces: tuple[Surface, ...],
        colliders: Iterable[F64], mask: int | None,
    ) -> None:  # fmt: skip
        word = piece.class_name.replace(" ", "_")
        if surfaces:
            own = replace(piece, surfaces=surfaces)
            data = glb_of_pieces(self._home.house, [own], with_lamps=False, in_place=False)
            _shape(link, "visual", "visual", self._mesh(word, ".glb", data))
        for k, part in enumerate(colliders):
            uri = self._mesh(f"{word}_part", ".obj", _obj(part))
            _shape(link, "collision", f"collision_{k}", uri, mask)

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


def link_name(part: str) -> str:
    """The name of a part's link and joint in its model: `door_1`; `link` of the body."""
    return "link" if part == BODY else f"part_{re.sub(r'[^A-Za-z0-9]+', '_', part).strip('_')}"


def _model(world: ET.Element, piece: Piece, name: str) -> tuple[ET.Element, F64]:
    """A model at its place, and (4, 4) the world from it."""
    model = ET.SubElement(world, "model", name=name)
    world_from_model = _Z_UP @ piece.world_from_local @ _Z_UP.T
    _put_pose(model, world_from_model)
    return model, world_from_model


def _joint(model: ET.Element, name: str, joint: Joint) -> None:
    """The joint of a part's link, in the piece's frame."""
    kind = "prismatic" if joint.kind is JointKind.PRISMATIC else "revolute"
    row = ET.SubElement(model, "joint", name=f"{name}_joint", type=kind)
    pose = _put(row, "pose", *(_Z_UP[:3, :3] @ joint.point), 0, 0, 0)
    pose.set("relative_to", "__model__")
    ET.SubElement(row, "parent").text = link_name(BODY)
    ET.SubElement(row, "child").text = name
    axis = ET.SubElement(row, "axis")
    _put(axis, "xyz", *(_Z_UP[:3, :3] @ joint.axis))
    limit = ET.SubElement(axis, "limit")
    _put(limit, "lower", joint.lower)
    _put(limit, "upper", joint.upper)
    dynamics = ET.SubElement(axis, "dynamics")
    for tag, value in zip(("damping", "friction"), effort_of(joint), strict=True):
        _put(dynamics, tag, value)


def _shape(link: ET.Element, tag: str, name: str, uri: str, mask: int | None = None) -> None:
    """A visual or a collision: a mesh with y up, turned to z up; mask: what it meets."""
    shape = ET.SubElement(link, tag, name=name)
    _put_pose(shape, _Z_UP)
    mesh = ET.SubElement(ET.SubElement(shape, "geometry"), "mesh")
    ET.SubElement(mesh, "uri").text = uri
    if mask is not None:
        contact = ET.SubElement(ET.SubElement(shape, "surface"), "contact")
        ET.SubElement(contact, "collide_bitmask").text = str(mask)


def _inertial(link: ET.Element, middle: F64, mass_kg: float, tensor: F64) -> None:
    """Mass in the middle (3,), and (3, 3) kg m2 about it; both of y up."""
    inertial = ET.SubElement(link, "inertial")
    _put(inertial, "pose", *(_Z_UP[:3, :3] @ middle), 0, 0, 0)
    _put(inertial, "mass", mass_kg)
    inertia = ET.SubElement(inertial, "inertia")
    turned = _Z_UP[:3, :3] @ tensor @ _Z_UP[:3, :3].T
    for a in range(3):
        for b in range(a, 3):
            _put(inertia, f"i{'xyz'[a]}{'xyz'[b]}", turned[a, b])


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
    "a world of Gazebo, SDF 1.9: `<id>/<id>.sdf` and `meshes/`, metres, z up, gravity; doors and drawers have"
    " joints and stand shut",
    remark=COLLIDES,
    up="z",
)
