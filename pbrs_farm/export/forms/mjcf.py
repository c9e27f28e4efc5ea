"""A home as a model of MuJoCo (MJCF): joints, convex parts, masses, loose items as free bodies. Effects: writes files.

Metres, z up. Doors and drawers have limits, damping and friction. A part does not collide with bodies
that it only touches along its way, since clearances are smaller than the margin of convex parts. Loose
items are dropped first and written in their rest pose (`mujoco_rest`).
"""

from __future__ import annotations

from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import MaterialKind
from pbrs_farm.core.joints import Joint, JointKind
from pbrs_farm.export.content import numbers, write_files
from pbrs_farm.export.form import REMARKS, HomeForm
from pbrs_farm.export.home_bodies import BODY, Body, by_material, effort_of, word_of
from pbrs_farm.export.home_files import digest_name, xml_bytes, z_up_points, z_up_pose
from pbrs_farm.export.home_pieces import ExportedHome, Lamp, Piece
from pbrs_farm.export.mujoco_rest import rest_of
from pbrs_farm.export.obj_files import obj_of_surfaces, png_textures, rgba_of
from pbrs_farm.export.passing import passing_pairs
from pbrs_farm.installation import need

_STEP_S: Final = 0.002
_ROUNDS: Final = 8  # rounds of falling; restless bodies are fixed after each
FIXED: Final = "fixed_without_rest"  # name of the model's text with their names
_ON_BOX_M: Final = 1e-4  # maximum distance of a box's corners from its sides


def write_mjcf(home: ExportedHome, folder: Path) -> None:
    """Write <house id>.xml, meshes/ and textures/. Needs the module mujoco."""
    need("mujoco")
    model = _Model(home)
    path = folder / f"{home.house.id}.xml"
    write_files(folder, [model.files, {path.name: xml_bytes(model.root)}])
    fixed = _settle(model, path)
    if fixed:
        custom = ET.SubElement(model.root, "custom")
        ET.SubElement(custom, "text", name=FIXED, data=" ".join(fixed))
    path.write_bytes(xml_bytes(model.root))
    if fixed:
        nouns = ("item", "is") if len(fixed) == 1 else ("items", "are")
        text = (
            f"{len(fixed)} {nouns[0]} did not come to rest and {nouns[1]} fixed: {', '.join(fixed)}"
        )
        (folder / REMARKS).write_text(f"{home.house.id}: {text}\n")


class _Model:
    """A home's document, and the files that it names."""

    def __init__(self, home: ExportedHome) -> None:
        self._home = home
        self.files: dict[str, bytes] = {}
        self.loose: dict[str, ET.Element] = {}  # name -> its body
        self.areas_m2: dict[str, float] = {}  # in plan
        self.root = ET.Element("mujoco", model=home.house.id)
        compiler = {"angle": "radian", "meshdir": "meshes", "texturedir": "textures"}
        ET.SubElement(self.root, "compiler", compiler)
        option = {"timestep": f"{_STEP_S}", "integrator": "implicitfast", "cone": "elliptic"}
        option["impratio"] = "10"
        ET.SubElement(self.root, "option", option)
        ET.SubElement(self.root, "size", memory="1G")
        visual = ET.SubElement(self.root, "visual")
        ET.SubElement(visual, "headlight", ambient=".35 .35 .35", diffuse=".35 .35 .35")
        ET.SubElement(visual, "map", znear="0.005")
        _defaults(ET.SubElement(self.root, "default"))
        self._asset = ET.SubElement(self.root, "asset")
        self._world = ET.SubElement(self.root, "worldbody")
        self._meshes: set[str] = set()
        self._materials()
        for piece in home.pieces:
            if piece.surfaces or piece.lamps:
                self._piece(piece)
        self._contact = ET.SubElement(self.root, "contact")
        self._equality = ET.SubElement(self.root, "equality")
        for (a, part_a), (b, part_b) in passing_pairs(home):
            names = {
                "body1": body_name(home.pieces[a], part_a),
                "body2": body_name(home.pieces[b], part_b),
            }
            ET.SubElement(self._contact, "exclude", names)

    def join(self, a: str, b: str) -> None:
        """Hold two loose bodies together, without contact."""
        ET.SubElement(self._contact, "exclude", body1=a, body2=b)
        ET.SubElement(self._equality, "weld", body1=a, body2=b)

    def _materials(self) -> None:
        house = self._home.house
        pictures = png_textures(house, self._home.materials)
        for key, (name, data) in pictures.items():
            self.files[f"textures/{name}"] = data
            ET.SubElement(self._asset, "texture", name=key, type="2d", file=name)
        for k in self._home.materials:
            material = house.materials[k]
            shine = 0.0 if material.roughness is None else 1 - material.roughness
            row = {"name": f"material_{k}", "rgba": numbers(rgba_of(material))}
            row |= {"specular": f"{max(material.specular):.4g}", "shininess": f"{shine:.4g}"}
            if material.kind is MaterialKind.BULB:
                row["emission"] = "1"
            if material.texture_id in pictures:
                row["texture"] = str(material.texture_id)
            ET.SubElement(self._asset, "material", row)

    def _piece(self, piece: Piece) -> None:
        place, turn = z_up_pose(piece.world_from_local)
        frame = {"pos": numbers(place), "quat": _quaternion(turn)}
        root = ET.SubElement(self._world, "body", {"name": piece.name} | frame)
        if not piece.is_fixed:
            ET.SubElement(root, "freejoint", name=piece.name)
            self.loose[piece.name] = root
            self.areas_m2[piece.name] = float(piece.size[0] * piece.size[2])
        for body in piece.bodies:
            element = root
            if body.joint is not None:
                element = ET.SubElement(root, "body", {"name": body.name, "gravcomp": "1"})
                _joint(element, body, body.joint)
            if body.joint is not None or not piece.is_fixed:
                _inertial(element, body)
            self._shapes(element, piece, body)
        for lamp in piece.lamps:
            _light(root, lamp, turn, place)

    def _shapes(self, element: ET.Element, piece: Piece, body: Body) -> None:
        for material, surfaces in by_material(body.surfaces):
            data = obj_of_surfaces(surfaces)
            name = f"{word_of(piece.class_name)}_{digest_name(data)}"
            if name not in self._meshes:
                self._meshes.add(name)
                self.files[f"meshes/{name}.obj"] = data
                ET.SubElement(self._asset, "mesh", name=name, file=f"{name}.obj")
            shape = {"class": "visual", "mesh": name, "material": f"material_{material}"}
            ET.SubElement(element, "geom", shape)
        for part in body.solids:
            _collider(element, self._asset, self._meshes, z_up_points(part))


def body_name(piece: Piece, part: str) -> str:
    """The name of a piece's body, or of one of its parts: `Fridge`, `Fridge.door_1`."""
    return piece.name if part == BODY else f"{piece.name}.{word_of(part)}"


def _quaternion(turn: F64) -> str:
    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    return numbers((w, x, y, z))


def _defaults(default: ET.Element) -> None:
    visual = ET.SubElement(default, "default", {"class": "visual"})
    row = {"type": "mesh", "group": "2", "contype": "0", "conaffinity": "0", "mass": "0"}
    ET.SubElement(visual, "geom", row)
    collider = ET.SubElement(default, "default", {"class": "collider"})
    row = {"group": "3", "type": "mesh", "condim": "6", "friction": "0.8 0.01 0.004", "mass": "0"}
    row |= {"rgba": "0.2 0.6 0.9 0.4", "solref": "0.005 1", "solimp": "0.97 0.995 0.0005"}
    ET.SubElement(collider, "geom", row)
    # Meshes may be open, and have no volume.
    ET.SubElement(default, "mesh", inertia="shell")


def _joint(element: ET.Element, body: Body, joint: Joint) -> None:
    damping, friction = effort_of(joint)
    row = {
        "name": body.name,
        "type": "slide" if joint.kind is JointKind.PRISMATIC else "hinge",
        "pos": numbers(z_up_points(np.array([joint.point]))[0]),
        "axis": numbers(z_up_points(np.array([joint.axis]))[0]),
        # Values count from the closed state, whatever the pose.
        "range": numbers((joint.lower, joint.upper)),
        "limited": "true",
        "ref": f"{joint.value:.9g}",
        "damping": f"{damping:.4g}",
        "frictionloss": f"{friction:.4g}",
        "armature": "0.01",
    }
    ET.SubElement(element, "joint", row)


def _inertial(element: ET.Element, body: Body) -> None:
    along_x, along_y, along_z = body.inertia
    row = {"pos": numbers(z_up_points(body.middle[None])[0]), "mass": f"{body.mass_kg:.6g}"}
    row["diaginertia"] = numbers((along_x, along_z, along_y))
    ET.SubElement(element, "inertial", row)


def _collider(body: ET.Element, asset: ET.Element, meshes: set[str], part: F64) -> None:
    """Add a convex part (V, 3), as a box if it is one."""
    low, high = part.min(0), part.max(0)
    is_box = len(part) == 8 and (
        np.minimum(np.abs(part - low), np.abs(part - high)).max() < _ON_BOX_M
    )
    if is_box:
        row = {"class": "collider", "type": "box", "pos": numbers((low + high) / 2)}
        ET.SubElement(body, "geom", row | {"size": numbers((high - low) / 2)})
        return
    text = numbers(part.ravel())
    name = f"part_{digest_name(text.encode())}"
    if name not in meshes:
        meshes.add(name)
        ET.SubElement(asset, "mesh", name=name, vertex=text)
    ET.SubElement(body, "geom", {"class": "collider", "mesh": name})


def _light(body: ET.Element, lamp: Lamp, turn: F64, place: F64) -> None:
    """Add a lamp to its body, in candela; MuJoCo's own pictures use its colour alone."""
    position = (z_up_points(lamp.position[None])[0] - place) @ turn
    row = {"pos": numbers(position), "diffuse": numbers(lamp.rgb_linear), "castshadow": "false"}
    row |= {"type": "point", "attenuation": "0 0 1", "intensity": f"{lamp.candela:.5g}"}
    row["bulbradius"] = f"{max(lamp.radius_m, 0.005):.4g}"
    if lamp.spot:
        towards, half_angle = lamp.spot
        looks = z_up_points(np.array([towards]))[0] @ turn
        row |= {"type": "spot", "dir": numbers(looks)}
        row["cutoff"] = f"{min(np.degrees(half_angle), 90):.4g}"
    ET.SubElement(body, "light", row)


def _settle(model: _Model, path: Path) -> list[str]:
    """Move the loose bodies to their rest poses; returns the names of those fixed instead."""
    from pbrs_farm.quiet_mujoco import mujoco

    fixed: list[str] = []
    for _ in range(_ROUNDS):
        names = list(model.loose)
        if not names:
            break
        world = mujoco.MjModel.from_xml_path(str(path))
        rest = rest_of(world, names, [model.areas_m2[name] for name in names])
        for name, pose, is_restless in zip(names, rest.poses, rest.restless, strict=True):
            body = model.loose[name]
            if is_restless:
                joint = body.find("freejoint")
                assert joint is not None
                body.remove(joint)
                del model.loose[name]
                fixed.append(name)
            else:
                body.set("pos", numbers(pose[:3]))
                body.set("quat", numbers(pose[3:]))
        for a, b in rest.joined:
            model.join(names[a], names[b])
        path.write_bytes(xml_bytes(model.root))
        if not rest.restless.any() and not rest.joined:
            break
    return fixed


FORM = HomeForm(
    "mjcf",
    write_mjcf,
    "a model of MuJoCo (extra `physics`): `<id>/<id>.xml`, `meshes/` and `textures/`, metres, z up; doors"
    " and drawers have joints, loose items are free bodies at rest",
    up="z",
)
