"""Read a MuJoCo model (MJCF) as a House. Effects: reads files.

MuJoCo compiles the model, so that defaults, includes and attached models are resolved. The visible
geoms become one glTF scene for the glTF reader: a top-level body with its descendants is an item.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import Y_UP_FROM_Z_UP, affine
from pbrs_farm.core.house import House, Source
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.home.room_use import named_kind
from pbrs_farm.quiet_mujoco import mujoco
from pbrs_farm.read.common.format import GivenFile, root_of
from pbrs_farm.read.common.name_classes import class_of_node_name
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.document import UNREAD
from pbrs_farm.read.gltf.node_classes import collection_of
from pbrs_farm.read.gltf.scene import Beside, house_of_gltf
from pbrs_farm.read.gltf.scene_writer import KEY, SceneWriter, joint_row, matrix_row
from pbrs_farm.read.mjcf.geoms import UNREAD as UNREAD_SHAPES
from pbrs_farm.read.mjcf.geoms import (
    is_endless,
    is_shown,
    material_row,
    name_of,
    png_of_texture,
    shape_of,
    texture_of,
)
from pbrs_farm.read.mjcf.model_files import files_of_model

_Row = dict[str, Any]
_OBJECT: Final = mujoco.mjtObj
_KINDS: Final = {
    mujoco.mjtJoint.mjJNT_HINGE: JointKind.REVOLUTE,
    mujoco.mjtJoint.mjJNT_SLIDE: JointKind.PRISMATIC,
}

_FLAT_M: Final = 0.02  # maximum height of a room's floor geom, metres
_LEAST_ROOM_M: Final = 2.0  # minimum size of a room; a smaller body with a room's name is an item, such as a kitchen unit


def read_mjcf(given: GivenFile, fields: ReadFields) -> House:
    """Read a model. Raises BadHouse, naming file and place.

    given.models: a folder with the model and all its files, if these are not below the model's own
    folder. Joint values are those of the first keyframe, else of the model.
    """
    path = given.path
    folder, name = root_of(given)
    files_of_model(folder, name)  # refuse what leads out of the folder before MuJoCo opens it
    notes = Notes(path.name, strict=fields.strict)
    model, data, collides = _compiled(given)
    scene = _Scene(model, data, collides, path.name, notes, fields)
    gltf = scene.gltf()
    beside = Beside.of(folder, name, lambda number: png_of_texture(model, int(number)))
    return house_of_gltf(
        gltf, Source("mjcf", path.name, folder.sha256), path.stem, fields, notes, beside
    )


def _compiled(given: GivenFile) -> tuple[Any, Any, list[bool]]:
    """The model, its body poses, and whether each of its geoms collides."""
    try:
        spec = mujoco.MjSpec.from_file(str(given.path))
        for mesh in spec.meshes:
            # Open and flat meshes have no volume.
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            if mesh.file and not spec.strippath:
                # MuJoCo 3 stores a path without its folder, and geoms.py reads the file.
                mesh.file = str(Path(spec.modelfiledir, spec.meshdir, mesh.file))
        collides = [bool(geom.contype or geom.conaffinity) for geom in spec.geoms]
        for geom in spec.geoms:
            # Nothing is simulated: no hull need be found.
            geom.contype = geom.conaffinity = 0
        model = spec.compile()
        order = [geom.id for geom in spec.geoms]
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        text = re.sub(r"^(XML )?Error: ", "", " ".join(str(error).split()))[:200]
        raise BadHouse(given.path, "", f"MuJoCo cannot load it: {text}") from None
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    return model, data, [c for _, c in sorted(zip(order, collides, strict=True))]


class _Scene:
    """Collects the glTF scene of a model. State: the parts added so far."""

    def __init__(
        self,
        model: Any,
        data: Any,
        collides: list[bool],
        file: str,
        notes: Notes,
        fields: ReadFields,
    ) -> None:
        self._model, self._data, self._file = model, data, file
        self._notes, self._fields = notes, fields
        self._scene = SceneWriter(file)
        turn = matrix_row(Y_UP_FROM_Z_UP)
        self._scene.nodes.append({"name": "", "matrix": turn, "children": []})
        self._textures: dict[int, int] = {}  # of the model -> of the document
        self._known: dict[Any, int] = {}
        self._unread: dict[str, int] = {}
        self._children: dict[int, list[int]] = {}
        for body in range(1, model.nbody):
            self._children.setdefault(int(model.body_parentid[body]), []).append(body)
        self._geoms = self._shown_geoms(collides)
        shown = [g for geoms in self._geoms.values() for g in geoms if not is_endless(model, g)]
        boxes = np.array([self._bounds(g) for g in shown]).reshape(-1, 2, 3)
        self._low = boxes[:, 0].min(0) if len(boxes) else np.zeros(3)
        self._high = boxes[:, 1].max(0) if len(boxes) else np.ones(3)

    def _shown_geoms(self, collides: list[bool]) -> dict[int, list[int]]:
        """Body -> visible geoms; pure collision geoms are excluded if the item has visual ones."""
        model = self._model
        shown: dict[int, list[int]] = {}
        for geom in range(model.ngeom):
            kind = mujoco.mjtGeom(int(model.geom_type[geom]))
            if is_shown(model, geom):
                if kind in UNREAD_SHAPES:
                    self._unread[UNREAD_SHAPES[kind]] = self._unread.get(UNREAD_SHAPES[kind], 0) + 1
                else:
                    shown.setdefault(int(model.geom_bodyid[geom]), []).append(geom)
        # Visual geoms do not collide; items with visual geoms have separate colliders.
        drawn = {
            int(model.body_rootid[b])
            for b, geoms in shown.items()
            if b and not all(collides[g] for g in geoms)
        }
        return {
            body: [g for g in geoms if not collides[g]]
            if int(model.body_rootid[body]) in drawn
            else geoms
            for body, geoms in shown.items()
        }

    def gltf(self) -> Gltf:
        """The document."""
        self._group(0, 0)
        for kind, n in self._unread.items():
            self._notes.add(UNREAD, kind, f"{n} geoms are {kind}s, which are not read")
        textures = [{"source": k} for k in range(len(self._textures))]
        images = [{"uri": str(k)} for k in self._textures]
        return self._scene.gltf(0, textures=textures, images=images)

    def _group(self, body: int, above: int) -> None:
        """Add the members of a grouping body separately: its geoms, and its child bodies."""
        has_floor = any(
            "floor" in self._words(g).lower() and not is_endless(self._model, g)
            for geoms in self._geoms.values()
            for g in geoms
        )
        is_room = bool(body) and _names_room(self._body_name(body))
        for geom in self._geoms.get(body, []):
            if is_endless(self._model, geom) and has_floor:
                continue
            node = self._geom_node(geom)
            name = self._words(geom)
            node["name"] = name
            may_be_floor = is_room or is_endless(self._model, geom)
            if may_be_floor and class_of_node_name(name) is None and self._height(geom) < _FLAT_M:
                node["extras"] = {"class": "floor"}
            self._scene.add_node(node, above)
        for child in self._children.get(body, []):
            if self._is_group(child):
                self._group(child, above)
            else:
                self._item(child, above)

    def _is_group(self, body: int) -> bool:
        """True if a body is a room or contains several items with class names."""
        name = self._body_name(body)
        if self._model.body_jntnum[body]:
            return False
        if _names_room(name) and self._is_as_large_as_a_room(body):
            return True
        name_class = class_of_node_name(name)
        if name_class is not None and collection_of(name, name_class) is None:
            return False
        below = self._children.get(body, [])
        classified = [b for b in below if class_of_node_name(self._body_name(b)) is not None]
        return not self._geoms.get(body) and len(classified) > 1

    def _is_as_large_as_a_room(self, body: int) -> bool:
        geoms = [g for b in self._below(body) for g in self._geoms.get(b, [])]
        boxes = np.array([self._bounds(g) for g in geoms]).reshape(-1, 2, 3)
        return bool(geoms and min((boxes[:, 1].max(0) - boxes[:, 0].min(0))[:2]) > _LEAST_ROOM_M)

    def _item(self, body: int, above: int) -> None:
        name = self._body_name(body)
        geoms = [g for b in self._below(body) for g in self._geoms.get(b, [])]
        if not geoms and not self._lights_of(body):
            return
        extras: _Row = {"one": True, "by_name": True, "item": name or f"body {body}"}
        if class_of_node_name(name) is None:
            words = [*map(self._words, geoms), *map(self._body_name, self._below(body))]
            name = next((w for w in words if class_of_node_name(w) is not None), name)
        root: _Row = {"name": name or f"body {body}", "children": [], "extras": extras}
        number = self._scene.add_node(root, above)
        self._parts(body, number, is_moving=False)

    def _parts(self, body: int, above: int, *, is_moving: bool) -> None:
        """Add the geoms of a body and its descendants; parts with a joint get a separate node."""
        joint = None if is_moving else self._joint(body)
        if joint is not None:
            above = self._scene.add_node(
                {"name": "", "children": [], "extras": {KEY: joint}}, above
            )
        for geom in self._geoms.get(body, []):
            self._scene.add_node(self._geom_node(geom), above)
        for light in self._lights_of(body, below=False):
            self._scene.add_node(self._light_node(light), above)
        for child in self._children.get(body, []):
            self._parts(child, above, is_moving=is_moving or joint is not None)

    def _joint(self, body: int) -> _Row | None:
        """How a body moves against the one above it, in the model's frame; None where it does not."""
        model, data = self._model, self._data
        for joint in range(
            int(model.body_jntadr[body]),
            int(model.body_jntadr[body]) + int(model.body_jntnum[body]),
        ):
            kind = _KINDS.get(mujoco.mjtJoint(int(model.jnt_type[joint])))
            if kind is None:
                continue
            limits = (-np.pi, np.pi) if kind is JointKind.REVOLUTE else (0.0, 0.0)
            if model.jnt_limited[joint]:
                limits = float(model.jnt_range[joint, 0]), float(model.jnt_range[joint, 1])
            part = self._body_name(body) or name_of(model, _OBJECT.mjOBJ_JOINT, joint)
            # In the coordinate of the limits: a joint with a reference is drawn at that value.
            value = float(data.qpos[model.jnt_qposadr[joint]])
            return joint_row(
                part or f"part {body}", kind, data.xanchor[joint], data.xaxis[joint], limits, value
            )
        return None

    def _geom_node(self, geom: int) -> _Row:
        matrix = affine(self._data.geom_xmat[geom].reshape(3, 3), self._data.geom_xpos[geom])
        if is_endless(self._model, geom):
            matrix[:2, 3] = ((self._low + self._high) / 2)[:2]
        node: _Row = {"name": "", "matrix": matrix_row(matrix)}
        mesh = self._mesh(geom)
        return node if mesh is None else node | {"mesh": mesh}

    def _mesh(self, geom: int) -> int | None:
        model = self._model
        size = tuple(model.geom_size[geom]) if model.geom_dataid[geom] < 0 else ()
        key = (
            int(model.geom_type[geom]),
            int(model.geom_dataid[geom]),
            size,
            self._material_key(geom),
        )
        if key in self._known:
            return self._known[key]
        shape = shape_of(model, geom, (self._high - self._low)[:2] / 2)
        if shape is None or not len(shape.faces):
            return None
        parts = [(shape.faces, self._material(geom))]
        place = f"geom {self._words(geom)[:60]}"
        self._known[key] = self._scene.add_mesh(shape, parts, place, self._fields)
        return self._known[key]

    def _material_key(self, geom: int) -> tuple[Any, ...]:
        return (int(self._model.geom_matid[geom]), tuple(self._model.geom_rgba[geom].tolist()))

    def _material(self, geom: int) -> int:
        key = ("material", self._material_key(geom))
        if key not in self._known:
            texture = texture_of(self._model, geom)
            if texture is not None:
                texture = self._textures.setdefault(texture, len(self._textures))
            self._scene.materials.append(material_row(self._model, geom, texture))
            self._known[key] = len(self._scene.materials) - 1
        return self._known[key]

    def _lights_of(self, body: int, *, below: bool = True) -> list[int]:
        """Lights inside an item; lights of the world belong to the viewer."""
        bodies = set(self._below(body)) if below else {body}
        directional = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
        return [
            k
            for k in range(self._model.nlight)
            if int(self._model.light_bodyid[k]) in bodies
            and self._model.light_type[k] != directional
        ]

    def _light_node(self, light: int) -> _Row:
        colour = np.asarray(self._model.light_diffuse[light], np.float64)
        colour = colour / max(float(colour.max()), 1e-6)
        row = {"type": "point", "color": colour.tolist(), "extras": {"assumed": True}}
        place = self._data.light_xpos[light].tolist()
        return {"name": "", "translation": place} | self._scene.add_light(row)

    def _below(self, body: int) -> Iterator[int]:
        yield body
        for child in self._children.get(body, []):
            yield from self._below(child)

    def _body_name(self, body: int) -> str:
        return name_of(self._model, _OBJECT.mjOBJ_BODY, body)

    def _words(self, geom: int) -> str:
        """Name of a geom for classification: its own, its mesh's or its material's, the first with a class."""
        model = self._model
        names = [name_of(model, _OBJECT.mjOBJ_GEOM, geom)]
        if model.geom_dataid[geom] >= 0:
            names.append(name_of(model, _OBJECT.mjOBJ_MESH, int(model.geom_dataid[geom])))
        if model.geom_matid[geom] >= 0:
            names.append(name_of(model, _OBJECT.mjOBJ_MATERIAL, int(model.geom_matid[geom])))
        names = [name for name in names if name]
        classified = (name for name in names if class_of_node_name(name) is not None)
        return next(classified, names[0] if names else f"geom {geom}")

    def _bounds(self, geom: int) -> F64:
        """(2, 3) the corners of a geom's box along the model's axes."""
        turn = self._data.geom_xmat[geom].reshape(3, 3)
        middle, half = self._model.geom_aabb[geom].reshape(2, 3)
        middle = self._data.geom_xpos[geom] + turn @ middle
        return np.stack([middle - np.abs(turn) @ half, middle + np.abs(turn) @ half])

    def _height(self, geom: int) -> float:
        """How high a geom is, metres."""
        low, high = self._bounds(geom)
        return float(high[2] - low[2])


def _names_room(name: str) -> bool:
    """Whether a body's name is a room's: `kitchen`, `room_4`."""
    return named_kind(name) is not None or "room" in re.split(r"[^a-z]+", name.lower())
