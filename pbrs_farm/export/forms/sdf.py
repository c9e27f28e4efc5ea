"""A home as a world of Gazebo, SDF 1.9. Effects: writes files.

Metres, z up, gravity; a static model for the building, and a model per item with visual, convex
collision parts, mass and lamps. Meshes are y up, as in glTF and Gazebo; their poses turn them.
Pieces that open have a link and a joint for each part, and are closed: Gazebo reads no state of joints.
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
from pbrs_farm.core.frames import Z_UP_FROM_Y_UP
from pbrs_farm.core.house import Surface
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.export.content import numbers, write_files
from pbrs_farm.export.form import HomeForm
from pbrs_farm.export.home_bodies import BODY, effort_of
from pbrs_farm.export.home_files import Z_UP, convex_obj, digest_name, write_shut_remark, xml_bytes
from pbrs_farm.export.home_glb import glb_of_pieces
from pbrs_farm.export.home_pieces import COLLIDES, ExportedHome, Lamp, Piece

_GRAVITY: Final = (0.0, 0.0, -9.81)
_BRIGHT_CD: Final = 100.0  # candela of intensity 1, since Gazebo's pictures have no exposure
_FAINT: Final = 0.01  # share of intensity 1 at a metre at which a light ends
_LEAST_RANGE_M: Final = 1.0
_BUILDING: Final = "building"
# collision bitmasks: fixed bodies collide with all but opening parts, which collide with loose
# items only
_STILL, _MOVING = 1, 2
_RESERVED: Final = (_BUILDING, "world")


def write_sdf(home: ExportedHome, folder: Path) -> None:
    """<house id>.sdf and meshes/."""
    world = _World(home)
    write_files(folder, [world.meshes, {f"{home.house.id}.sdf": xml_bytes(world.document)}])
    write_shut_remark(home, folder)


class _World:
    """A home's document, and the meshes that it names: path below the document's folder -> bytes."""

    def __init__(self, home: ExportedHome) -> None:
        self._home = home
        self.meshes: dict[str, bytes] = {}
        self.document = ET.Element("sdf", version="1.9")
        world = ET.SubElement(self.document, "world", name=home.house.id)
        _put(world, "gravity", *_GRAVITY)
        self._building(world)
        pieces = (*(piece for piece in home.building if piece.opens), *home.things)
        for piece, name in zip(pieces, _model_names(pieces), strict=True):
            if piece.opens:
                self._opening(world, piece, name)
            else:
                self._thing(world, piece, name)

    def _building(self, world: ET.Element) -> None:
        pieces = [piece for piece in self._home.building if not piece.opens]
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
        """Add a model with a link for each body; a fixed piece has a joint with the world."""
        model, world_from_model = _model(world, piece, name)
        ET.SubElement(model, "static").text = "false"
        for body in piece.bodies:
            link = ET.SubElement(model, "link", name=link_name(body.part))
            shape = body.shape(body.shut)
            _inertial(link, shape.middle, body.mass_kg, shape.inertia)
            mask = None if not piece.is_fixed else _STILL if body.joint is None else _MOVING
            self._shapes(link, piece, shape.surfaces, shape.colliders, mask)
            if body.joint is not None:
                ET.SubElement(link, "gravity").text = "false"  # counterbalanced
                _joint(model, link_name(body.part), body.joint)
                continue
            inverse = np.asarray(np.linalg.inv(world_from_model), np.float64)
            _lights(link, name, piece.lamps, inverse)
            if piece.is_fixed:
                row = ET.SubElement(model, "joint", name="at", type="fixed")
                ET.SubElement(row, "parent").text = "world"
                ET.SubElement(row, "child").text = link_name(BODY)

    def _shapes(
        self,
        link: ET.Element,
        piece: Piece,
        surfaces: tuple[Surface, ...],
        colliders: Iterable[F64],
        mask: int | None,
    ) -> None:
        word = piece.class_name.replace(" ", "_")
        if surfaces:
            visual = replace(piece, surfaces=surfaces)
            data = glb_of_pieces(self._home.house, [visual], with_lamps=False, in_place=False)
            _shape(link, "visual", "visual", self._mesh(word, ".glb", data))
        for k, part in enumerate(colliders):
            uri = self._mesh(f"{word}_part", ".obj", convex_obj(part))
            _shape(link, "collision", f"collision_{k}", uri, mask)

    def _mesh(self, word: str, suffix: str, data: bytes) -> str:
        """The URI of a mesh; equal ones are one file."""
        name = f"meshes/{word}_{digest_name(data)}{suffix}"
        self.meshes[name] = data
        return name


def _model_names(pieces: Iterable[Piece]) -> list[str]:
    """The pieces' names, different from reserved names of SDF and the building's."""
    taken, names = set(_RESERVED), []
    for piece in pieces:
        name = piece.name
        while name in taken:
            name += "_thing"
        taken.add(name)
        names.append(name)
    return names


def _put(parent: ET.Element, tag: str, *values: float) -> ET.Element:
    child = ET.SubElement(parent, tag)
    child.text = numbers(values)
    return child


def _put_pose(parent: ET.Element, b_from_a: F64) -> None:
    turn = Rotation.from_matrix(b_from_a[:3, :3]).as_quat()
    child = _put(parent, "pose", *b_from_a[:3, 3], *turn)
    child.set("rotation_format", "quat_xyzw")


def link_name(part: str) -> str:
    """The name of a part's link and joint in its model: `door_1`; `link` of the body."""
    return "link" if part == BODY else f"part_{re.sub(r'[^A-Za-z0-9]+', '_', part).strip('_')}"


def _model(world: ET.Element, piece: Piece, name: str) -> tuple[ET.Element, F64]:
    """Add a model in its pose; returns it and (4, 4) the world from it."""
    model = ET.SubElement(world, "model", name=name)
    world_from_model = Z_UP_FROM_Y_UP @ piece.world_from_local @ Z_UP_FROM_Y_UP.T
    _put_pose(model, world_from_model)
    return model, world_from_model


def _joint(model: ET.Element, name: str, joint: Joint) -> None:
    """Add the joint of a part's link, in the piece's frame."""
    kind = "prismatic" if joint.kind is JointKind.PRISMATIC else "revolute"
    row = ET.SubElement(model, "joint", name=f"{name}_joint", type=kind)
    pose = _put(row, "pose", *(Z_UP @ joint.point), 0, 0, 0)
    pose.set("relative_to", "__model__")
    ET.SubElement(row, "parent").text = link_name(BODY)
    ET.SubElement(row, "child").text = name
    axis = ET.SubElement(row, "axis")
    _put(axis, "xyz", *(Z_UP @ joint.axis))
    limit = ET.SubElement(axis, "limit")
    _put(limit, "lower", joint.lower)
    _put(limit, "upper", joint.upper)
    dynamics = ET.SubElement(axis, "dynamics")
    for tag, value in zip(("damping", "friction"), effort_of(joint), strict=True):
        _put(dynamics, tag, value)


def _shape(link: ET.Element, tag: str, name: str, uri: str, mask: int | None = None) -> None:
    """Add a visual or a collision: a mesh with y up, turned to z up; mask: of its collisions."""
    shape = ET.SubElement(link, tag, name=name)
    _put_pose(shape, Z_UP_FROM_Y_UP)
    mesh = ET.SubElement(ET.SubElement(shape, "geometry"), "mesh")
    ET.SubElement(mesh, "uri").text = uri
    if mask is not None:
        contact = ET.SubElement(ET.SubElement(shape, "surface"), "contact")
        ET.SubElement(contact, "collide_bitmask").text = str(mask)


def _inertial(link: ET.Element, middle: F64, mass_kg: float, tensor: F64) -> None:
    """Add a mass in the middle (3,), and (3, 3) kg m2 about it; both y up."""
    inertial = ET.SubElement(link, "inertial")
    _put(inertial, "pose", *(Z_UP @ middle), 0, 0, 0)
    _put(inertial, "mass", mass_kg)
    inertia = ET.SubElement(inertial, "inertia")
    turned = Z_UP @ tensor @ Z_UP.T
    for a in range(3):
        for b in range(a, 3):
            _put(inertia, f"i{'xyz'[a]}{'xyz'[b]}", turned[a, b])


def _lights(link: ET.Element, name: str, lamps: Sequence[Lamp], link_from_world: F64) -> None:
    """Add lamps to their link, so that they move with it. They cast no shadow, since a bulb would hide them."""
    link_from_home = link_from_world @ Z_UP_FROM_Y_UP
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
            # Gazebo has the whole angle of a cone, at most a half space.
            for tag, value in (("inner_angle", 0.0), ("outer_angle", min(2 * half_angle, np.pi))):
                _put(spot, tag, value)
            _put(spot, "falloff", 1)


FORM = HomeForm(
    "sdf",
    write_sdf,
    "a world of Gazebo, SDF 1.9: `<id>/<id>.sdf` and `meshes/`, metres, z up, gravity; doors and drawers have"
    " joints and are closed",
    remark=COLLIDES,
    up="z",
)
