"""Parse a world or model of SDF: models as robots, lights, includes; effects: reads included files.

A pose is relative to the model, a joint's to its child, unless `relative_to` names another frame. The
poses of models are those of the world's state, if it has one.
"""

from __future__ import annotations

import posixpath
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.joints import JointKind
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder
from pbrs_farm.read.robot.links import model_name
from pbrs_farm.read.robot.urdf import (
    GREY,
    KINDS,
    MAX_BYTES,
    Link,
    LinkJoint,
    Robot,
    Visual,
    numbers_of,
    parsed_xml,
    solid_of,
    unit_axis,
)

_MODEL: Final = "__model__"
_PLACED: Final = ("model", "include")
_MOST_MODELS: Final = 10_000  # models and includes
_MOST_DEPTH: Final = 20  # of includes, and of frames relative to others
# of Gazebo's own library, which worlds do not bring along
_GROUND: Final = (
    b'<sdf><model name="ground_plane"><link name="link"><visual name="visual"><geometry><plane>'
    b"<size>100 100</size></plane></geometry></visual></link></model></sdf>"
)
_ENDLESS: Final = 1e3  # radians or metres; a wider limit means no limit


@dataclass(frozen=True, slots=True)
class Light:
    """A point or spot light."""

    link: str  # "" of the world
    link_from_light: F64  # (4, 4)
    rgb: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class SdfModel:
    """A model of a world."""

    name: str
    world_from_model: F64  # (4, 4)
    robot: Robot
    lights: tuple[Light, ...]
    folder: str  # of its file, below the root


def models_of_sdf(folder: RootFolder, file: str, notes: Notes) -> Iterator[SdfModel]:
    """The models of a document with those it includes; a damaged or missing one is a note.

    Lights of the world are a model without links. Raises BadHouse if the document is damaged, or has more
    than 10,000 models and includes.
    """
    root = parsed_xml(folder.read(file, max_bytes=MAX_BYTES) or b"", file, "sdf")
    walk = _Walk(folder, notes)
    for world in [*root.findall("world"), root]:
        states = {str(row.get("name")): row for row in world.findall("state/model")}
        for row in world:
            if row.tag in _PLACED and _name_of(row) in states:
                _replace_pose(row, states[_name_of(row)].find("pose"))
        yield from walk.models_in(world, file, np.eye(4), 0)
        lights = tuple(_light(row, "", file) for row in world.findall("light") if _shines(row))
        if lights:
            parent = posixpath.dirname(file)
            yield SdfModel("", np.eye(4), Robot(()), lights, parent)
    if walk.n_rows > _MOST_MODELS:
        raise BadHouse(file, "model", f"more than {_MOST_MODELS} models and includes")


class _Walk:
    """Visits models and includes; state: their number so far, beyond whose limit none is visited."""

    def __init__(self, folder: RootFolder, notes: Notes) -> None:
        self._folder, self._notes = folder, notes
        self.n_rows = 0

    def models_in(self, parent: Element, file: str, frame: F64, depth: int) -> Iterator[SdfModel]:
        """The models and includes directly below an element; frame: (4, 4) the world from it."""
        for row in parent:
            if row.tag not in _PLACED:
                continue
            self.n_rows += 1
            if self.n_rows > _MOST_MODELS:
                return
            name = _name_of(row)
            place = f"{row.tag} {name[:60]}"
            try:
                if depth > _MOST_DEPTH:
                    raise BadHouse(file, place, f"is nested more than {_MOST_DEPTH} deep")
                if row.tag == "include":
                    yield from self._included(row, file, frame, depth)
                    continue
                world_from_model = frame @ _pose(row, file, place)
                yield _model(row, name, world_from_model, file)
                yield from self.models_in(row, file, world_from_model, depth + 1)
            except BadHouse as error:
                text = f"{error.message[:200]}; it is left out"
                self._notes.add("unreadable-model", place, text)

    def _included(self, row: Element, file: str, frame: F64, depth: int) -> Iterator[SdfModel]:
        uri, parent = (row.findtext("uri") or "").strip(), posixpath.dirname(file)
        name = model_name(uri, self._folder, parent)
        if self._folder.has_folder(name) or not name.endswith(".sdf"):
            name = model_name(f"{uri.rstrip('/')}/model.sdf", self._folder, parent)
        data = self._folder.read(name, max_bytes=MAX_BYTES)
        if data is None and uri == "model://ground_plane":
            data = _GROUND
        if data is None:
            if uri != "model://sun":
                self._notes.add("missing-model", f"include {uri[:80]}", "has no model here")
            return
        root, own_name = parsed_xml(data, name, "sdf"), (row.findtext("name") or "").strip()
        for model in root.findall("model")[:1]:
            model.set("name", own_name or str(model.get("name")))
            _replace_pose(model, row.find("pose"))
        yield from self.models_in(root, name, frame, depth + 1)


def _name_of(row: Element) -> str:
    named = row.get("name") or row.findtext("name") or row.findtext("uri") or row.tag
    return named.strip()


def _replace_pose(row: Element, pose: Element | None) -> None:
    if pose is not None:
        for old in row.findall("pose"):
            row.remove(old)
        row.append(pose)


class _Frames:
    """Poses in a model of its links, joints and frames."""

    def __init__(self, model: Element, file: str) -> None:
        self._rows = {
            str(row.get("name")): row for row in model if row.tag in ("link", "joint", "frame")
        }
        self._file = file

    def of(self, name: str, depth: int = 0) -> F64:
        """(4, 4) the model from a frame; BadHouse for an unknown name or a cycle."""
        if name in (_MODEL, ""):
            return np.eye(4)
        row = self._rows.get(name)
        if row is None or depth > _MOST_DEPTH:
            raise BadHouse(self._file, f"frame {name[:60]}", "is not here, or refers to itself")
        usual = {"joint": row.findtext("child") or "", "frame": row.get("attached_to") or ""}
        return self.posed(row, usual.get(row.tag, ""), f"{row.tag} {name[:60]}", depth)

    def posed(self, row: Element, usual: str, place: str, depth: int = 0) -> F64:
        """(4, 4) the model from an element; usual: the frame of its pose if it names none."""
        pose = row.find("pose")
        named = (None if pose is None else pose.get("relative_to")) or usual
        return np.asarray(self.of(named.strip(), depth + 1) @ _pose(row, self._file, place))


def _model(model: Element, name: str, world_from_model: F64, file: str) -> SdfModel:
    """A model; links are in the frame of the joint with their parent, as in URDF."""
    frames = _Frames(model, file)
    rows = {str(row.get("name")): row for row in model.findall("link")}
    joint_of: dict[str, Element] = {}
    for row in model.findall("joint"):
        child = (row.findtext("child") or "").strip()
        if child in rows and (row.findtext("parent") or "").strip() in rows:
            joint_of.setdefault(child, row)
    order = _parents_first(rows, joint_of, file)
    frame_of: dict[str, F64] = {}
    links, lights, n_unread = [], [], 0
    for link in order:
        place = f"model {name[:40]}: link {link[:40]}"
        joint_row, parent, joint = joint_of.get(link), None, None
        frame_of[link] = np.eye(4)
        if joint_row is not None:
            parent = (joint_row.findtext("parent") or "").strip()
            frame_of[link] = frames.of(str(joint_row.get("name")))
            parent_from_joint = np.linalg.inv(frame_of[parent]) @ frame_of[link]
            joint = _joint(joint_row, np.asarray(parent_from_joint), frame_of[link], file)
        link_from_own = np.linalg.inv(frame_of[link]) @ frames.of(link)
        visuals = []
        for visual in rows[link].findall("visual"):
            shown = _visual(visual, np.asarray(link_from_own), file, place)
            n_unread += shown is None
            visuals += [] if shown is None else [shown]
        for light in rows[link].findall("light"):
            if _shines(light):
                lights.append(_light(light, link, file, np.asarray(link_from_own)))
        links.append(Link(link, tuple(visuals), parent, joint))
    parent_folder = posixpath.dirname(file)
    robot = Robot(tuple(links), n_unread=n_unread)
    return SdfModel(name, world_from_model, robot, tuple(lights), parent_folder)


def _parents_first(rows: dict[str, Element], joint_of: dict[str, Element], file: str) -> list[str]:
    order: dict[str, None] = {}
    waiting = list(rows)
    while waiting:
        later = []
        for name in waiting:
            joint = joint_of.get(name)
            if joint is None or (joint.findtext("parent") or "").strip() in order:
                order[name] = None
            else:
                later.append(name)
        if len(later) == len(waiting):
            raise BadHouse(file, "joint", "the links form a cycle")
        waiting = later
    return list(order)


def _joint(row: Element, parent_from_joint: F64, model_from_joint: F64, file: str) -> LinkJoint:
    name = str(row.get("name"))
    place, kind = f"joint {name[:60]}", KINDS.get(str(row.get("type")))
    axis = numbers_of(row.findtext("axis/xyz"), (0.0, 0.0, 1.0), file, place)
    if row.find("axis/use_parent_model_frame") is not None:
        is_of_model = row.findtext("axis/use_parent_model_frame") in ("1", "true")
        axis = model_from_joint[:3, :3].T @ axis if is_of_model else axis
    limits = []
    for tag, sign in (("lower", -1.0), ("upper", 1.0)):
        text = (row.findtext(f"axis/limit/{tag}") or "").strip().lower()
        try:
            limit = float(text) if text else sign * np.inf
        except ValueError:
            raise BadHouse(file, place, f"{text[:40]!r} is not a number") from None
        endless = sign * np.pi if kind is JointKind.REVOLUTE else 0.0
        limits.append(limit if abs(limit) < _ENDLESS else endless)
    return LinkJoint(name, kind, parent_from_joint, unit_axis(axis, file, place), *limits)


def _visual(row: Element, link_from_own: F64, file: str, place: str) -> Visual | None:
    matrix = np.asarray(link_from_own @ _pose(row, file, place))
    uri = (row.findtext("geometry/mesh/uri") or "").strip()
    colour = row.findtext("material/diffuse") or row.findtext("material/ambient")
    rgba = numbers_of(colour, GREY, file, place)
    if uri:
        scale = row.findtext("geometry/mesh/scale")
        matrix[:3, :3] *= numbers_of(scale, (1.0, 1.0, 1.0), file, place)
        return Visual(uri, matrix, rgba=tuple(rgba.clip(0, 1)))
    solid = solid_of(row, rgba, file, place)
    return None if solid is None else Visual("", matrix, solid)


def _shines(row: Element) -> bool:
    return row.get("type") in ("point", "spot")


def _light(row: Element, link: str, file: str, link_from_own: F64 | None = None) -> Light:
    place = f"light {str(row.get('name'))[:60]}"
    pose = _pose(row, file, place)
    rgba = numbers_of(row.findtext("diffuse"), (1.0, 1.0, 1.0, 1.0), file, place).clip(0, 1)
    r, g, b = (rgba[:3] / max(float(rgba[:3].max()), 1e-6)).tolist()
    return Light(link, pose if link_from_own is None else link_from_own @ pose, (r, g, b))


def _pose(row: Element, file: str, place: str) -> F64:
    """(4, 4) of the element's pose: x y z, then roll pitch yaw or a quaternion."""
    pose, matrix = row.find("pose"), np.eye(4)
    if pose is None or not (pose.text or "").strip():
        return matrix
    if pose.get("rotation_format") == "quat_xyzw":
        values = numbers_of(pose.text, (0.0,) * 7, file, place)
        if np.linalg.norm(values[3:]) < 1e-6:
            raise BadHouse(file, place, "its pose has no rotation")
        matrix[:3, :3] = Rotation.from_quat(values[3:]).as_matrix()
    else:
        values = numbers_of(pose.text, (0.0,) * 6, file, place)
        is_degrees = pose.get("degrees") in ("1", "true")
        turn = Rotation.from_euler("xyz", values[3:], degrees=is_degrees)
        matrix[:3, :3] = turn.as_matrix()
    matrix[:3, 3] = values[:3]
    return matrix
