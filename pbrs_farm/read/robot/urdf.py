"""Parse URDF: links, their visible shapes, their joints; no effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final
from xml.etree.ElementTree import Element, ParseError

import numpy as np
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import affine
from pbrs_farm.core.joints import JointKind
from pbrs_farm.read.common.notes import Notes

MAX_BYTES: Final = 16 * 2**20
_MOST_LINKS: Final = 20_000
GREY: Final = (0.7, 0.7, 0.7, 1.0)  # of solids without a colour
_SOLIDS: Final = {
    "box": (("size", 3),),
    "cylinder": (("radius", 1), ("length", 1)),
    "sphere": (("radius", 1),),
    "plane": (("size", 2),),
}  # solid -> its fields, each with its number of values
KINDS: Final = {
    "revolute": JointKind.REVOLUTE,
    "continuous": JointKind.REVOLUTE,
    "prismatic": JointKind.PRISMATIC,
}


@dataclass(frozen=True, slots=True)
class Solid:
    """A shape without a file, about its middle; a cylinder is along z, a plane across it."""

    kind: str  # box, cylinder, sphere or plane
    size: tuple[float, ...]  # metres: sides, radius and length, or radius
    rgba: tuple[float, float, float, float]  # sRGB-encoded


@dataclass(frozen=True, slots=True)
class Visual:
    """A model or solid that shows a link."""

    file: str  # as the robot's file names it; "" for a solid
    link_from_model: F64  # (4, 4), with its scale
    solid: Solid | None = None
    rgba: tuple[float, ...] | None = None  # sRGB-encoded colour of a model without materials


@dataclass(frozen=True, slots=True)
class LinkJoint:
    """Joint between a link and its parent."""

    name: str
    kind: JointKind | None  # None: fixed
    parent_from_joint: F64  # (4, 4), at value 0
    axis: F64  # (3,) unit, in the joint's frame
    lower: float
    upper: float

    def parent_from_link(self, value: float) -> F64:
        """(4, 4) pose of the link at a value, radians or metres."""
        moved = np.eye(4)
        if self.kind is JointKind.REVOLUTE:
            moved[:3, :3] = Rotation.from_rotvec(value * self.axis).as_matrix()
        elif self.kind is JointKind.PRISMATIC:
            moved[:3, 3] = value * self.axis
        return np.asarray(self.parent_from_joint @ moved)


@dataclass(frozen=True, slots=True)
class Link:
    """A rigid part."""

    name: str
    visuals: tuple[Visual, ...]
    parent: str | None  # None: the root
    joint: LinkJoint | None  # to the parent


@dataclass(frozen=True, slots=True)
class Robot:
    """The links of a URDF, parents first."""

    links: tuple[Link, ...]
    moving: tuple[str, ...] = ()  # names of joints that are not fixed, in the file's order
    n_unread: int = 0  # skipped shapes: capsules, height maps

    def values(self, pose: Any, file: str, place: str, order: str = "") -> dict[str, float]:
        """Joint values by name, radians or metres, from a Habitat scene.

        pose: a list in the order of the links ("urdf_order": of the file, else of the tree), or an object
        by joints' names; missing joints are 0. Raises BadHouse for anything else.
        """
        if not pose:
            return {}
        names = self.moving
        if order != "urdf_order":
            names = tuple(x.joint.name for x in self.links if x.joint and x.joint.kind is not None)
        rows = pose if isinstance(pose, Mapping) else None
        if rows is None and isinstance(pose, Sequence) and not isinstance(pose, str):
            rows = dict(zip(names, pose, strict=False))
        values = (
            None
            if rows is None
            else {k: v[0] if isinstance(v, list) and len(v) == 1 else v for k, v in rows.items()}
        )
        if values is None or not all(
            type(v) in (int, float) and abs(v) < 1e6 for v in values.values()
        ):
            raise BadHouse(file, place, "expected a number for each joint, in a list or by name")
        return {name: float(v) for name, v in values.items() if name in names}


def robot_from_urdf(data: bytes, file: str, notes: Notes | None = None) -> Robot:
    """The links and joints of a URDF; BadHouse where it is damaged, or its joints make no tree.

    Collision shapes and masses are not read, nor the materials of models that have their own.
    notes: of a home, of whose links a damaged one is left out with a note, and all below it.
    """
    root = parsed_xml(data, file, "robot")
    colours = {str(row.get("name")): row for row in root.findall("material")}
    rows = {str(row.get("name")): row for row in root.findall("link")}
    if not rows or len(rows) > _MOST_LINKS:
        raise BadHouse(file, "link", f"has {len(rows)} links; 1 to {_MOST_LINKS} are read")
    hung: dict[str, tuple[str, LinkJoint]] = {}
    lost: set[str] = set()  # links without a place, or with damaged shapes
    for row in root.findall("joint"):
        parent, child = (_named(row, tag, rows, file) for tag in ("parent", "child"))
        try:
            joint = _joint(row, file)
        except BadHouse as error:
            _leave_out(child, error, lost, notes)
            continue
        if child in hung:
            raise BadHouse(file, f"joint {joint.name[:60]}", f"{child[:60]} has two parents")
        hung[child] = (parent, joint)
    below: dict[str | None, list[str]] = {}
    for name in rows:
        below.setdefault(hung[name][0] if name in hung else None, []).append(name)
    n_links = 0
    links, waiting, n_unread = [], list(reversed(below.get(None, []))), 0
    while waiting:
        name = waiting.pop()
        n_links += 1
        waiting += reversed(below.get(name, []))
        above = hung.get(name)
        parent_name = None if above is None else above[0]
        try:
            visuals, n = _visuals(rows[name], colours, file)
        except BadHouse as error:
            _leave_out(name, error, lost, notes)
        if name in lost or parent_name in lost:
            lost.add(name)
            continue
        n_unread += n
        links.append(Link(name, visuals, parent_name, None if above is None else above[1]))
    if n_links < len(rows):
        raise BadHouse(file, "joint", "the links form a cycle")
    moving = tuple(joint.name for _, joint in hung.values() if joint.kind is not None)
    return Robot(tuple(links), moving, n_unread)


def _leave_out(name: str, error: BadHouse, lost: set[str], notes: Notes | None) -> None:
    if notes is None:
        raise error
    lost.add(name)
    notes.add("unreadable-model", f"link {name[:60]}", f"{error.message[:200]}; it is left out")


def parsed_xml(data: bytes, file: str, tag: str) -> Element:
    """The root of an XML document; BadHouse if it is damaged or has another tag."""
    try:
        root: Element = fromstring(data, forbid_dtd=True)
    except (ParseError, DefusedXmlException, ValueError, LookupError, RecursionError) as error:
        raise BadHouse(file, "", f"is not valid XML: {str(error)[:100]}") from None
    if root.tag != tag:
        raise BadHouse(file, "", f"begins with <{str(root.tag)[:40]}>, not <{tag}>")
    return root


def _named(row: Element, tag: str, links: Mapping[str, Any], file: str) -> str:
    child = row.find(tag)
    name = "" if child is None else str(child.get("link"))
    if name not in links:
        raise BadHouse(file, f"joint {str(row.get('name'))[:60]}", f"its {tag} is not a link")
    return name


def _joint(row: Element, file: str) -> LinkJoint:
    name, kind = str(row.get("name")), KINDS.get(str(row.get("type")))
    place = f"joint {name[:60]}"
    axis_row, limit = row.find("axis"), row.find("limit")
    axis = numbers_of(
        None if axis_row is None else axis_row.get("xyz"), (1.0, 0.0, 0.0), file, place
    )
    turns = np.pi if row.get("type") == "continuous" else 0.0
    lower, upper = (
        float(numbers_of(None if limit is None else limit.get(key), (default,), file, place)[0])
        for key, default in (("lower", -turns), ("upper", turns))
    )
    direction = unit_axis(axis, file, place)
    return LinkJoint(name, kind, _origin(row, file, place), direction, lower, upper)


def unit_axis(axis: F64, file: str, place: str) -> F64:
    """A joint's axis at length 1; BadHouse where it has no direction."""
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        raise BadHouse(file, place, "its axis has no direction")
    return np.asarray(axis / length)


def _visuals(
    row: Element, colours: Mapping[str, Element], file: str
) -> tuple[tuple[Visual, ...], int]:
    """The models and solids that show a link, and the number of other shapes."""
    visuals, n_unread = [], 0
    place = f"link {str(row.get('name'))[:60]}"
    for visual in row.findall("visual"):
        mesh, matrix = visual.find("geometry/mesh"), _origin(visual, file, place)
        named = visual.find("material")
        colour = named if named is None or len(named) else colours.get(str(named.get("name")))
        said = None if colour is None else colour.find("color")
        rgba = numbers_of(None if said is None else said.get("rgba"), GREY, file, place)
        if mesh is not None and mesh.get("filename"):
            matrix[:3, :3] *= numbers_of(mesh.get("scale"), (1.0, 1.0, 1.0), file, place)
            visuals.append(Visual(str(mesh.get("filename")), matrix, rgba=tuple(rgba.clip(0, 1))))
            continue
        solid = solid_of(visual, rgba, file, place)
        n_unread += solid is None
        if solid is not None:
            visuals.append(Visual("", matrix, solid))
    return tuple(visuals), n_unread


def solid_of(visual: Element, rgba: F64, file: str, place: str) -> Solid | None:
    """The solid of a visual of URDF (attributes) or SDF (elements); None for another shape."""
    for kind, fields in _SOLIDS.items():
        shape = visual.find(f"geometry/{kind}")
        if shape is not None:
            texts = [shape.get(key) or shape.findtext(key) for key, _ in fields]
            sizes = [
                numbers_of(text, (0.0,) * n, file, place)
                for text, (_, n) in zip(texts, fields, strict=True)
            ]
            size = tuple(np.concatenate(sizes).tolist())
            r, g, b, opacity = rgba.clip(0, 1).tolist()
            return Solid(kind, size, (r, g, b, opacity)) if min(size) > 0 else None
    return None


def _origin(row: Element, file: str, place: str) -> F64:
    origin, zero = row.find("origin"), (0.0, 0.0, 0.0)
    if origin is None:
        return np.eye(4)
    # Roll about x, then pitch about y, then yaw about z, of fixed axes.
    rpy = numbers_of(origin.get("rpy"), zero, file, place)
    xyz = numbers_of(origin.get("xyz"), zero, file, place)
    return affine(Rotation.from_euler("xyz", rpy).as_matrix(), xyz)


def numbers_of(text: str | None, default: tuple[float, ...], file: str, place: str) -> F64:
    """The numbers of a text, as many as the default has; BadHouse if they are not finite."""
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if len(values) != len(default) or not (np.abs(values) < 1e9).all():
        raise BadHouse(file, place, f"{text[:40]!r} is not {len(default)} finite numbers")
    return values
