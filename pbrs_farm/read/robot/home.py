"""A home in URDF or SDF -> House: links become nodes of one glTF scene. Reads the file and its models."""

from __future__ import annotations

import posixpath
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import Y_UP_FROM_Z_UP, transform_points
from pbrs_farm.core.house import House, ItemKind, Source
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import GivenFile, root_of
from pbrs_farm.read.common.name_classes import class_of_node_name
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.gltf.assembly import Assembly, files_of_asset
from pbrs_farm.read.gltf.document import UNREAD, placed_nodes
from pbrs_farm.read.gltf.scene import Beside, house_of_gltf, side_files
from pbrs_farm.read.robot.links import (
    PLANE,
    RootsOf,
    model_name,
    placed_links,
    roots_of_robot,
    solid_roots,
)
from pbrs_farm.read.robot.sdf import SdfModel, models_of_sdf
from pbrs_farm.read.robot.urdf import GREY, MAX_BYTES, Link, Robot, Solid, Visual, robot_from_urdf

_MODELS: Final = (".glb", ".gltf", ".obj", ".stl")
_GROUND_M: Final = 0.1  # thickness of the floor made of a plane


def read_robot(given: GivenFile, fields: ReadFields) -> House:
    """Read a home. Raises BadHouse, naming file and place; a damaged or missing model is a note.

    given.models: a folder that holds the file and its models, if these are not below the file's own.
    All joints are at 0: neither form has a state.
    """
    folder, name = root_of(given)
    notes = Notes(name, strict=fields.strict)
    scene = _Scene(Assembly(name, folder, fields.max_model_triangles), notes)
    for model in _models(folder, name, notes):
        scene.add(model)
    if not scene.built.roots:
        hint = "give a folder that holds the file and its models: --models FOLDER"
        raise BadHouse(name, "", "none of its models is here", hint=hint)
    scene.add_ground()
    scene.note_losses()
    beside = Beside.of(folder, name, scene.built.fetch)
    source = Source("robot", given.path.name, folder.sha256)
    return house_of_gltf(scene.built.gltf(), source, given.path.stem, fields, notes, beside)


def companions_of_robot(given: GivenFile, files: SourceFiles) -> str:
    """Digest of all other files that the reader opens; "" if there are none."""
    folder, name = root_of(given)
    parent = posixpath.dirname(name)
    names = {folder.name_from(parent, other) for other in side_files(given.path)}
    for model in _models(folder, name, Notes(name, strict=False)):
        visuals = {v.file for link in model.robot.links for v in link.visuals if v.file}
        for model_file in {model_name(v, folder, model.folder) for v in visuals}:
            if model_file.lower().endswith(_MODELS) and folder.path(model_file) is not None:
                names |= files_of_asset(folder, model_file, files)
    return files.digest(folder, names | set(folder.names_read) - {name})


def _models(folder: RootFolder, name: str, notes: Notes) -> list[SdfModel]:
    """The models of a world; a URDF is one model without a name."""
    data = folder.read(name, max_bytes=MAX_BYTES)
    if data is None:
        raise BadHouse(name, "", "no such file")
    if b"<sdf" in data:
        return list(models_of_sdf(folder, name, notes))
    robot = robot_from_urdf(data, name, notes)
    return [SdfModel("", np.eye(4), robot, (), posixpath.dirname(name))]


class _Scene:
    """The glTF scene of a home; state: the models added so far, and the counts of missing files."""

    def __init__(self, built: Assembly, notes: Notes) -> None:
        self.built = built
        self._notes = notes
        self._missing: set[str] = set()
        self._foreign: set[str] = set()  # models in formats that are not read
        self._n_unread = 0
        self._ground: float | None = None  # height of the highest plane, metres
        self._has_floor = False

    def add(self, model: SdfModel) -> None:
        """Place a model, each of its items a node with the item's name."""
        robot = model.robot
        self._n_unread += robot.n_unread
        for visual in (v for link in robot.links for v in link.visuals):
            if visual.solid is not None and visual.solid.kind == PLANE:
                height = float(model.world_from_model[2, 3] + visual.link_from_model[2, 3])
                self._ground = height if self._ground is None else max(height, self._ground)
        node_of = placed_links(self.built, robot, self._roots_of(model.folder), {}, 1.0)
        nodes = self.built.document["nodes"]
        for light in model.lights:
            bulb = {"type": "point", "color": list(light.rgb), "extras": {"assumed": True}}
            node = self.built.light_node(bulb, light.link_from_light[:3, 3], "")
            if light.link in node_of:
                nodes[node_of[light.link]]["children"].append(node)
            else:
                self.built.place([node], Y_UP_FROM_Z_UP @ model.world_from_model, "", {})
        if not node_of:
            return
        self._name_items(robot, model.name, node_of)
        roots = roots_of_robot(robot, node_of)
        self.built.place(roots, Y_UP_FROM_Z_UP @ model.world_from_model, "", {})

    def add_ground(self) -> None:
        """Add a floor below the walls, else below everything, if a plane is the only floor."""
        rows = [] if self._ground is None or self._has_floor else list(self._boxes())
        if not rows:
            return
        boxes = [box for is_wall, box in rows if is_wall] or [box for _, box in rows]
        low, high = np.min([b[0] for b in boxes], 0), np.max([b[1] for b in boxes], 0)
        middle = np.eye(4)
        middle[:3, 3] = [(low[0] + high[0]) / 2, self._ground, (low[2] + high[2]) / 2]
        size = (float(high[0] - low[0]), _GROUND_M, float(high[2] - low[2]))
        middle[1, 3] -= _GROUND_M / 2
        roots = solid_roots(self.built, Solid("box", size, GREY))
        self.built.place(roots, middle, "ground", {"class": "floor"})

    def _boxes(self) -> Iterator[tuple[bool, F64]]:
        """Whether a placed mesh is a wall's, and (2, 3) its box, y up."""
        gltf = self.built.gltf()
        names = [str(node.get("name", "")) for node in gltf.document["nodes"]]
        classes = [class_of_node_name(name) for name in names]
        walls = {k for k, c in enumerate(classes) if c is not None and c.kind is ItemKind.WALL}
        accessors = gltf.document.get("accessors", [])
        for node in placed_nodes(gltf):
            mesh = gltf.document["nodes"][node.index].get("mesh")
            for row in [] if mesh is None else gltf.document["meshes"][mesh]["primitives"]:
                bounds = accessors[row["attributes"]["POSITION"]]
                if "min" in bounds and "max" in bounds:
                    ends = zip(bounds["min"], bounds["max"], strict=True)
                    corners = np.array(np.meshgrid(*ends, indexing="ij")).reshape(3, 8).T
                    points = transform_points(node.world_from_node, corners)
                    box = np.stack([points.min(0), points.max(0)])
                    yield not walls.isdisjoint(node.path), box

    def note_losses(self) -> None:
        """Note the models that are missing or in other formats, and the shapes that are not read."""
        for kind, names, text in (
            ("missing-model", self._missing, "are not here"),
            (UNREAD, self._foreign, f"are not read; models are {', '.join(_MODELS)}"),
        ):
            if names:
                first = ", ".join(sorted(names)[:3])
                self._notes.add(kind, "visual", f"{len(names)} models {text}: {first[:150]}")
        if self._n_unread:
            self._notes.add(UNREAD, "visual", f"{self._n_unread} shapes are not read")

    def _roots_of(self, at: str) -> RootsOf:
        def roots_of(visual: Visual) -> list[int] | None:
            reference = visual.file
            try:
                name = model_name(reference, self.built.folder, at)
                if not name.lower().endswith(_MODELS):
                    self._foreign.add(name)
                    return None
                added = self.built.asset(name, visual.rgba)
            except BadHouse as error:
                text = f"{error.message[:200]}; it is left out"
                self._notes.add("unreadable-model", reference[:100], text)
                return None
            if added is None:
                self._missing.add(name)
            return added and added[0]

        return roots_of

    def _name_items(self, robot: Robot, model: str, node_of: dict[str, int]) -> None:
        """Make items of the uppermost links with a shape or a moving part; the others are groups."""
        below: dict[str | None, list[Link]] = {}
        for link in robot.links:
            below.setdefault(link.parent, []).append(link)
        waiting = list(below.get(None, []))
        n_roots = len(below.get(None, []))
        while waiting:
            link = waiting.pop()
            parts = below.get(link.name, [])
            moves = any(part.joint and part.joint.kind is not None for part in parts)
            if not link.visuals and not moves:
                waiting += parts
                continue
            # Several bodies of a model are items with names of their own: the walls of a house.
            is_own = not model or (n_roots > 1 and link.name != "link")
            name = link.name if is_own else model
            files = [posixpath.basename(v.file).rpartition(".")[0] for v in link.visuals]
            words = [name, *(part.name for part in parts), *files]
            classified = next((w for w in words if class_of_node_name(w) is not None), name)
            node: dict[str, Any] = self.built.document["nodes"][node_of[link.name]]
            node["name"] = classified
            kind = class_of_node_name(classified)
            self._has_floor |= kind is not None and kind.kind is ItemKind.FLOOR
            node["extras"] |= {"one": True, "by_name": True, "item": name, "name": name}
