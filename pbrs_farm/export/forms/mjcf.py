"""A home as a model of MuJoCo (MJCF): joints, convex parts, masses, loose things as free bodies. Effects: writes files.

Metres, z up. Doors and drawers have limits, damping and friction; what touches a part along its way
without being in it is passed through (clearances are below what convex parts keep). Loose things
are let fall before the home is written, and stand where they came to rest (`mujoco_rest`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Final
from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import MaterialKind
from pbrs_farm.core.joints import JointKind
from pbrs_farm.export.form import REMARKS, HomeForm
from pbrs_farm.export.home_links import BODY, Link, effort_of
from pbrs_farm.export.home_pieces import ExportedHome, Lamp, Piece, digest_name
from pbrs_farm.export.mujoco_rest import rest_of
from pbrs_farm.export.obj_files import obj_of_surfaces, png_textures, rgba_of, z_up_points
from pbrs_farm.export.passing import passing_pairs
from pbrs_farm.geometry.convex_parts import slabs
from pbrs_farm.installation import need

_STEP_S: Final = 0.002
_ROUNDS: Final = 5  # in which what finds no rest is fixed
_ON_BOX_M: Final = 1e-4
_Z_UP: Final = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


def write_mjcf(home: ExportedHome, folder: Path) -> None:
    """<house id>.xml, meshes/ and textures/. Needs the module mujoco."""
    need("mujoco")
    model = _Model(home)
    for name, data in model.files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    path = folder / f"{home.house.id}.xml"
    path.write_bytes(model.text)
    fixed = _settle(model, path)
    path.write_bytes(model.text)
    if fixed:
        (folder / REMARKS).write_text(
            f"{home.house.id}: {len(fixed)} things found no rest and stand fixed: {', '.join(fixed[:5])}\n"
        )


class _Model:
    """A home's document, and the files that it names."""

    def __init__(self, home: ExportedHome) -> None:
        self._home = home
        self.files: dict[str, bytes] = {}
        self.loose: dict[str, ET.Element] = {}  # name -> its body
        self.areas_m2: dict[str, float] = {}  # in plan
        self._root = ET.Element("mujoco", model=home.house.id)
        compiler = {"angle": "radian", "meshdir": "meshes", "texturedir": "textures"}
        ET.SubElement(self._root, "compiler", compiler)
        option = {"timestep": f"{_STEP_S}", "integrator": "implicitfast", "cone": "elliptic"}
        option["impratio"] = "10"
        ET.SubElement(self._root, "option", option)
        ET.SubElement(self._root, "size", memory="1G")
        visual = ET.SubElement(self._root, "visual")
        ET.SubElement(visual, "headlight", ambient=".35 .35 .35", diffuse=".35 .35 .35")
        ET.SubElement(visual, "map", znear="0.005")
        _defaults(ET.SubElement(self._root, "default"))
        self._asset = ET.SubElement(self._root, "asset")
        self._world = ET.SubElement(self._root, "worldbody")
        self._meshes: set[str] = set()
        self._materials()
        for piece in home.pieces:
            if piece.surfaces or piece.lamps:
                self._piece(piece)
        contact = ET.SubElement(self._root, "contact")
        for (a, part_a), (b, part_b) in passing_pairs(home):
            bodies = {
                "body1": body_name(home.pieces[a], part_a),
                "body2": body_name(home.pieces[b], part_b),
            }
            ET.SubElement(contact, "exclude", bodies)

    @property
    def text(self) -> bytes:
        """The document."""
        ET.indent(self._root)
        text: bytes = ET.tostring(self._root, encoding="utf-8", xml_declaration=True)
        return text + b"\n"

    def _materials(self) -> None:
        house = self._home.house
        used = sorted({s.material for p in self._home.pieces for s in p.surfaces})
        pictures = png_textures(house, used)
        for key, (name, data) in pictures.items():
            self.files[f"textures/{name}"] = data
            ET.SubElement(self._asset, "texture", name=key, type="2d", file=name)
        for k in used:
            material = house.materials[k]
            shine = 0.0 if material.roughness is None else 1 - material.roughness
            row = {"name": f"material_{k}", "rgba": _numbers(rgba_of(material))}
            row |= {"specular": f"{max(material.specular):.4g}", "shininess": f"{shine:.4g}"}
            if material.kind is MaterialKind.BULB:
                row["emission"] = "1"
            if material.texture_id in pictures:
                row["texture"] = str(material.texture_id)
            ET.SubElement(self._asset, "material", row)

    def _piece(self, piece: Piece) -> None:
        turn = _Z_UP @ piece.world_from_local[:3, :3] @ _Z_UP.T
        place = z_up_points(piece.world_from_local[None, :3, 3])[0]
        frame = {"pos": _numbers(place), "quat": _quaternion(turn)}
        body = ET.SubElement(self._world, "body", {"name": piece.name} | frame)
        if not piece.is_fixed:
            ET.SubElement(body, "freejoint", name=piece.name)
            self.loose[piece.name] = body
            self.areas_m2[piece.name] = float(piece.size[0] * piece.size[2])
        for link in piece.links:
            own = body
            if link.joint is not None:
                name = {"name": body_name(piece, link.part), "gravcomp": "1"}
                own = ET.SubElement(body, "body", name)
                _joint(own, piece, link)
            if link.joint is not None or not piece.is_fixed:
                _inertial(own, link)
            self._shapes(own, piece, link)
        for lamp in piece.lamps:
            _light(body, lamp, turn, place)

    def _shapes(self, body: ET.Element, piece: Piece, link: Link) -> None:
        for material in sorted({s.material for s in link.surfaces}):
            own = [s for s in link.surfaces if s.material == material]
            data = obj_of_surfaces(own)
            name = f"{_word(piece.class_name)}_{digest_name(data)}"
            if name not in self._meshes:
                self._meshes.add(name)
                self.files[f"meshes/{name}.obj"] = data
                ET.SubElement(self._asset, "mesh", name=name, file=f"{name}.obj")
            shape = {"class": "visual", "mesh": name, "material": f"material_{material}"}
            ET.SubElement(body, "geom", shape)
        is_wall = piece.item.kind.is_structure
        for part in slabs(link.triangles) if is_wall else link.colliders:
            _collider(body, self._asset, self._meshes, z_up_points(part))


def body_name(piece: Piece, part: str) -> str:
    """The name of a piece's body, or of one of its parts: `Fridge`, `Fridge.door_1`."""
    return piece.name if part == BODY else f"{piece.name}.{_word(part)}"


def _word(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "_", text).strip("_") or "part"


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{float(x):.9g}" for x in values)


def _quaternion(turn: F64) -> str:
    x, y, z, w = Rotation.from_matrix(turn).as_quat()
    return _numbers((w, x, y, z))


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


def _joint(body: ET.Element, piece: Piece, link: Link) -> None:
    joint = link.joint
    assert joint is not None
    damping, friction = effort_of(joint)
    row = {
        "name": body_name(piece, link.part),
        "type": "slide" if joint.kind is JointKind.PRISMATIC else "hinge",
        "pos": _numbers(z_up_points(np.array([joint.point]))[0]),
        "axis": _numbers(z_up_points(np.array([joint.axis]))[0]),
        # Its value counts from the shut state, wherever it stands.
        "range": _numbers((joint.lower, joint.upper)), "limited": "true", "ref": f"{joint.value:.9g}",
        "damping": f"{damping:.4g}", "frictionloss": f"{friction:.4g}", "armature": "0.01",
    }  # fmt: skip
    ET.SubElement(body, "joint", row)


def _inertial(body: ET.Element, link: Link) -> None:
    along_x, along_y, along_z = link.inertia
    row = {"pos": _numbers(z_up_points(link.middle[None])[0]), "mass": f"{link.mass_kg:.6g}"}
    row["diaginertia"] = _numbers((along_x, along_z, along_y))
    ET.SubElement(body, "inertial", row)


def _collider(body: ET.Element, asset: ET.Element, meshes: set[str], part: F64) -> None:
    """A convex part (V, 3): a box where it is one."""
    low, high = part.min(0), part.max(0)
    is_box = len(part) == 8 and (
        np.minimum(np.abs(part - low), np.abs(part - high)).max() < _ON_BOX_M
    )
    if is_box:
        row = {"class": "collider", "type": "box", "pos": _numbers((low + high) / 2)}
        ET.SubElement(body, "geom", row | {"size": _numbers((high - low) / 2)})
        return
    text = _numbers(part.ravel())
    name = f"part_{digest_name(text.encode())}"
    if name not in meshes:
        meshes.add(name)
        ET.SubElement(asset, "mesh", name=name, vertex=text)
    ET.SubElement(body, "geom", {"class": "collider", "mesh": name})


def _light(body: ET.Element, lamp: Lamp, turn: F64, place: F64) -> None:
    """A lamp in its body, candela; MuJoCo's own pictures count its colour alone."""
    at = (z_up_points(lamp.position[None])[0] - place) @ turn
    row = {"pos": _numbers(at), "diffuse": _numbers(lamp.rgb_linear), "castshadow": "false"}
    row |= {"type": "point", "attenuation": "0 0 1", "intensity": f"{lamp.candela:.5g}"}
    row["bulbradius"] = f"{max(lamp.radius_m, 0.005):.4g}"
    if lamp.spot:
        towards, half_angle = lamp.spot
        looks = z_up_points(np.array([towards]))[0] @ turn
        row |= {"type": "spot", "dir": _numbers(looks)}
        row["cutoff"] = f"{min(np.degrees(half_angle), 90):.4g}"
    ET.SubElement(body, "light", row)


# Rest


def _settle(model: _Model, path: Path) -> list[str]:
    """Place the loose bodies where they come to rest; the names of those fixed instead."""
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
                body.set("pos", _numbers(pose[:3]))
                body.set("quat", _numbers(pose[3:]))
        path.write_bytes(model.text)
        if not rest.restless.any():
            break
    return fixed


FORM = HomeForm(
    "mjcf",
    write_mjcf,
    "a model of MuJoCo (extra `physics`): `<id>/<id>.xml`, `meshes/` and `textures/`, metres, z up; doors"
    " and drawers have joints, loose things are free bodies at rest",
    up="z",
)
