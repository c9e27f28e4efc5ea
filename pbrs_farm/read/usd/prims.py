"""Prims of a composed stage as nodes of a glTF document in metres, y up, properties as extras; no effects."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from pxr import Kind, Usd, UsdGeom, UsdLux, UsdShade

from pbrs_farm.core.arrays import I64
from pbrs_farm.core.classes import LAMP
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import is_flattening
from pbrs_farm.core.house import MAX_INSTANCES, ItemKind
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats.glb import Gltf
from pbrs_farm.formats.house_glb import V_DOWN
from pbrs_farm.home.room_use import named_kind
from pbrs_farm.read.common.name_classes import NodeClass, class_of_node_name
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.document import MAX_DEPTH, MAX_NODES, UNREAD
from pbrs_farm.read.gltf.scene_writer import SceneWriter, matrix_row
from pbrs_farm.read.mesh.shape import Shape
from pbrs_farm.read.usd.joints import add_joints
from pbrs_farm.read.usd.shaders import Shaders
from pbrs_farm.read.usd.shapes import NOT_READ, light_shape, mesh_shape, solid_shape

EXTRAS_ATTRIBUTE: Final = "pbrs:item"
"""Of a prim: JSON that our own exports say of an item, as extras of its node."""
LUMEN_ATTRIBUTE: Final = "pbrs:lumen"
"""Of a light: the flux that leaves it, as our own exports say."""
_SKIPPED_PURPOSES: Final = ("proxy", "guide")
_STRUCTURE: Final = (ItemKind.WALL, ItemKind.FLOOR, ItemKind.CEILING)
_MOST_ID: Final = 100  # characters of an item's id

_Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Above:
    """Properties inherited from ancestors of a prim."""

    node: int
    depth: int
    name: str  # of the item, in ids
    in_lamp: bool = False
    structure: NodeClass | None = None  # what a label above says, of walls, floors and ceilings


class StageNodes:
    """Collects the nodes of a stage. State: the nodes added so far."""

    def __init__(
        self, stage: Any, file: str, notes: Notes, shaders: Shaders, fields: ReadFields
    ) -> None:
        self._stage, self._file, self._notes, self._fields = stage, file, notes, fields
        self._shaders = shaders
        self._time = Usd.TimeCode.EarliestTime()
        self._scene = SceneWriter(file)
        self._nodes = self._scene.nodes
        self._known: dict[Any, int | None] = {}
        self._unread: dict[str, int] = {}
        self._nodes_of: dict[str, list[int]] = {}  # path of a prim -> its nodes
        self._holders = _holders(stage)

    def gltf(self, scene_extras: _Row) -> Gltf:
        """The document of the whole stage."""
        metres = float(UsdGeom.GetStageMetersPerUnit(self._stage))
        world = np.diag([metres, metres, metres, 1.0])
        if UsdGeom.GetStageUpAxis(self._stage) == UsdGeom.Tokens.z:
            # (x, y, z) with z up is (x, z, -y) with y up.
            world[:3, :3] = metres * np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
        self._nodes.append({"name": "", "matrix": matrix_row(world), "children": []})
        stack = [(p, _Above(0, 1, "")) for p in reversed(_children(self._stage.GetPseudoRoot()))]
        while stack:
            prim, above = stack.pop()
            stack += reversed(list(self._visit(prim, above)))
        add_joints(self._stage, self._nodes, self._nodes_of, self._notes)
        for kind, n in self._unread.items():
            self._notes.add(UNREAD, kind, f"{n} prims are {kind}, which are not read")
        shaders = self._shaders
        self._scene.materials += shaders.materials
        pictures = {"textures": shaders.textures, "images": shaders.images}
        return self._scene.gltf(0, scene_extras, samplers=shaders.samplers, **pictures)

    def _visit(self, prim: Any, above: _Above) -> Iterator[tuple[Any, _Above]]:
        """Add a prim's node; yields the children to visit."""
        if _is_hidden(prim) or _is_no_place(prim):
            return
        if above.depth >= MAX_DEPTH:
            raise BadHouse(self._file, str(prim.GetPath())[:80], f"is deeper than {MAX_DEPTH}")
        if prim.IsA(UsdGeom.PointInstancer):
            yield from self._instances(prim, above)
            return
        own_above = self._node(
            prim, above, self._matrix(prim), prim.GetName(), f"{above.name}/{prim.GetName()}"
        )
        yield from ((child, own_above) for child in _children(prim))

    def _matrix(self, prim: Any) -> Any:
        xformable = UsdGeom.Xformable(prim)
        if not xformable:
            return None
        if xformable.GetResetXformStack():
            # Undo the transforms of its ancestors.
            cache = UsdGeom.XformCache(self._time)
            world = np.array(cache.GetLocalToWorldTransform(prim))
            parent = np.array(cache.GetParentToWorldTransform(prim))
            if is_flattening(parent[:3, :3]):
                return world
            return world @ np.linalg.inv(parent)
        return np.array(xformable.GetLocalTransformation(self._time))

    def _node(self, prim: Any, above: _Above, matrix: Any, name: str, path: str) -> _Above:
        if len(self._nodes) >= MAX_NODES:
            raise BadHouse(self._file, str(prim.GetPath())[:80], f"more than {MAX_NODES} prims")
        node: _Row = {"name": name[:200], "children": [], "extras": {"item": _item_id(path)}}
        if matrix is not None and not np.array_equal(matrix, np.eye(4)):
            if not np.isfinite(matrix).all():
                raise BadHouse(self._file, str(prim.GetPath())[:80], "its transform is not finite")
            # Rows of USD are columns of glTF, in the same order of numbers.
            node["matrix"] = matrix.ravel().tolist()
        mesh = self._mesh(prim)
        if mesh is not None:
            node["mesh"] = mesh
        cls = self._class(prim, above, node)
        in_lamp = above.in_lamp or (cls is not None and cls.kind is ItemKind.LAMP)
        in_lamp = in_lamp or bool(
            prim.GetAttribute(EXTRAS_ATTRIBUTE).Get()
        )  # says what its lights are
        if prim.HasAPI(UsdLux.LightAPI) or prim.IsA(UsdLux.BoundableLightBase):
            self._light(prim, node, is_part=above.in_lamp)
        number = self._scene.add_node(node, above.node)
        self._nodes_of.setdefault(str(prim.GetPath()), []).append(number)
        label = cls if cls and cls.is_tagged and cls.kind in _STRUCTURE else above.structure
        return _Above(number, above.depth + 1, path, in_lamp, label)

    def _class(self, prim: Any, above: _Above, node: _Row) -> NodeClass | None:
        """The prim's class; written to the node's extras if the prim has it."""
        own_extras = prim.GetAttribute(EXTRAS_ATTRIBUTE).Get()
        if own_extras:
            from pbrs_farm.core.checked_json import json_from_bytes

            extras = json_from_bytes(str(own_extras).encode(), self._file)
            node["extras"] |= extras if isinstance(extras, dict) else {}
            return class_of_node_name(str(node["extras"].get("class", "")))
        label = _own_label(prim)
        label_class = class_of_node_name(label) if label else None
        is_shape = "mesh" in node
        if label_class is None:
            if (
                is_shape
                and above.structure is not None
                and class_of_node_name(prim.GetName()) is None
            ):
                self._tag(node, above.structure)
            elif _is_component(prim) and str(prim.GetPath()) not in self._holders:
                self._component(prim, node)
            elif not is_shape and self._is_group(prim):
                node["extras"]["group"] = True
                return None
            return class_of_node_name(prim.GetName())
        # A label of walls on what holds many walls is each one's.
        is_group = not is_shape and label_class.kind in _STRUCTURE
        if not is_group:
            self._tag(node, label_class)
        return NodeClass(label_class.nyu40, label_class.kind, is_tagged=True)

    def _is_group(self, prim: Any) -> bool:
        """True if a prim is a room's scope, contains classified items or groups items of its name."""
        own_class = class_of_node_name(prim.GetName())
        if own_class is not None and own_class.kind is ItemKind.LAMP:
            return False
        if named_kind(prim.GetName()) is not None or str(prim.GetPath()) in self._holders:
            return True
        # The three chairs of a Chair_grp are three items.
        is_model_group = Usd.ModelAPI(prim).GetKind() == Kind.Tokens.group
        names = [child.GetName() for child in _children(prim)] if is_model_group else []
        return own_class is not None and own_class in map(class_of_node_name, names)

    def _component(self, prim: Any, node: _Row) -> None:
        own_class = class_of_node_name(prim.GetName())
        inner = [class_of_node_name(p.GetName()) for p in _visible_children(prim)]
        classes = {inner_class for inner_class in inner if inner_class is not None}
        if own_class is not None:
            node["extras"]["by_name"] = True
        elif len(classes) == 1:
            own_class = next(iter(classes))
        if own_class is None:
            node["extras"]["one"] = True
        elif own_class.kind not in _STRUCTURE:
            self._tag(node, own_class)

    def _tag(self, node: _Row, node_class: NodeClass) -> None:
        node["extras"] |= {"nyu40": node_class.nyu40, "kind": node_class.kind.value}

    # Shapes

    def _mesh(self, prim: Any) -> int | None:
        if prim.GetTypeName() in NOT_READ:
            kind = str(prim.GetTypeName())
            self._unread[kind] = self._unread.get(kind, 0) + 1
        if not prim.IsA(UsdGeom.Gprim) and not prim.IsA(UsdLux.BoundableLightBase):
            return None
        bound = self._bound_material(prim)
        # Instances of one prototype share its mesh.
        source = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        key = (str(source.GetPath()), str(bound.GetPath()) if bound else "")
        if key not in self._known:
            self._known[key] = self._new_mesh(prim, bound)
        return self._known[key]

    def _new_mesh(self, prim: Any, bound: Any) -> int | None:
        is_light = prim.IsA(UsdLux.BoundableLightBase)
        if is_light:
            shape, material = (
                light_shape(prim, self._time),
                self._shaders.shining(_light_colour(prim)[0]),
            )
            parts: list[tuple[I64, int | None]] = []
            parts += [] if shape is None else [(shape.faces, material)]
        else:
            is_mesh = prim.IsA(UsdGeom.Mesh)
            shape = (
                mesh_shape(prim, self._time, self._file, self._uv_name(prim, bound))
                if is_mesh
                else solid_shape(prim, self._time)
            )
            parts = [] if shape is None else list(self._parts(prim, shape, bound))
        if shape is None or not parts:
            return None
        if shape.uvs is not None:
            down = shape.uvs.astype(np.float32) * V_DOWN + np.array([0, 1], np.float32)
            shape = replace(shape, uvs=down.astype(np.float64))
        place, name = str(prim.GetPath()), prim.GetName()[:100]
        return self._scene.add_mesh(shape, parts, place, self._fields, name=name)

    def _parts(self, prim: Any, shape: Shape, bound: Any) -> Iterator[tuple[I64, int | None]]:
        """(triangles, material) of each subset of a mesh's faces, and of the rest."""
        rest = np.ones(len(shape.faces), np.bool_)
        binding = UsdShade.MaterialBindingAPI(prim)
        for subset in binding.GetMaterialBindSubsets() if len(shape.polygon) else ():
            chosen = np.asarray(subset.GetIndicesAttr().Get(self._time) or [], np.int64)
            is_own = np.isin(shape.polygon, chosen) & rest
            rest &= ~is_own
            material = self._bound_material(subset.GetPrim())
            if is_own.any():
                yield shape.faces[is_own], self._material(prim, material)
        if rest.any():
            yield shape.faces[rest], self._material(prim, bound)

    def _uv_name(self, prim: Any, bound: Any) -> str:
        """The texture coordinates that the materials of a mesh ask for, those of its subsets first."""
        subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
        materials = [*(self._bound_material(s.GetPrim()) for s in subsets), bound]
        return next(filter(None, (self._shaders.uv_name(m) for m in materials if m)), "")

    def _bound_material(self, prim: Any) -> Any:
        """The material for full renders, else for all purposes, else a supported preview material."""
        binding = UsdShade.MaterialBindingAPI(prim)
        full = binding.ComputeBoundMaterial(UsdShade.Tokens.full)[0]
        if full and self._shaders.is_understood(full):
            return full
        preview = binding.ComputeBoundMaterial(UsdShade.Tokens.preview)[0]
        is_better = preview and (not full or self._shaders.is_understood(preview))
        return preview if is_better else full

    def _material(self, prim: Any, material: Any) -> int | None:
        if material:
            return self._shaders.number(material)
        # Without a material a prim may have a colour.
        primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance("displayColor")
        colours = primvar.ComputeFlattened(self._time) if primvar and primvar.HasValue() else None
        if colours is None or not len(colours):
            return None
        mean = np.asarray(colours, np.float64).reshape(-1, 3).mean(0)
        if not np.isfinite(mean).all():
            return None
        r, g, b = (round(float(c), 4) for c in np.clip(mean, 0, 1))
        return self._shaders.plain((r, g, b))

    # Lights

    def _light(self, prim: Any, node: _Row, *, is_part: bool) -> None:
        """Let a node shine. Suns and skies are the recipe's."""
        if prim.IsA(UsdLux.NonboundableLightBase):
            node.pop("mesh", None)
            return
        if not is_part and "nyu40" not in node["extras"]:
            node["extras"] |= {"nyu40": LAMP, "kind": ItemKind.LAMP.value}
        flux = prim.GetAttribute(LUMEN_ATTRIBUTE).Get()
        if "mesh" in node and flux is None:
            return  # its own surface shines
        node.pop("mesh", None)
        rgb, is_given = _light_colour(prim)
        row: _Row = {"type": "point", "extras": {}} | ({"color": list(rgb)} if is_given else {})
        radius = prim.GetAttribute("inputs:radius").Get(self._time)
        scale = float(UsdGeom.GetStageMetersPerUnit(self._stage))
        if radius is not None and np.isfinite(radius) and radius > 0:
            row["extras"]["radius_m"] = float(radius) * scale
        cone = prim.GetAttribute("inputs:shaping:cone:angle").Get(self._time)
        cutoff = np.pi
        if cone is not None and 0 < cone < 180:
            cutoff = float(np.radians(cone))
            row |= {"type": "spot", "spot": {"outerConeAngle": cutoff}}
        if flux is None or not np.isfinite(flux):
            row["extras"]["assumed"] = True
        else:
            row["intensity"] = float(flux / (2 * np.pi * (1 - np.cos(cutoff))))
        node |= self._scene.add_light(row)

    # Instances

    def _instances(self, prim: Any, above: _Above) -> Iterator[tuple[Any, _Above]]:
        instancer = UsdGeom.PointInstancer(prim)
        path = f"{above.name}/{prim.GetName()}"
        holder = self._node(prim, above, self._matrix(prim), prim.GetName(), path)
        numbers = np.asarray(instancer.GetProtoIndicesAttr().Get(self._time) or [], np.int64)
        paths = instancer.GetPrototypesRel().GetForwardedTargets()
        if len(numbers) > MAX_INSTANCES:
            text = f"{len(numbers)} instances, at most {MAX_INSTANCES} are read"
            raise BadHouse(self._file, str(prim.GetPath()), text)
        if not len(numbers) or not paths:
            return
        if not 0 <= numbers.min() <= numbers.max() < len(paths):
            raise BadHouse(self._file, str(prim.GetPath()), "names a prototype that does not exist")
        # The prototypes' own places are part of each instance's.
        places = instancer.ComputeInstanceTransformsAtTime(
            self._time,
            self._time,
            UsdGeom.PointInstancer.IncludeProtoXform,
            UsdGeom.PointInstancer.IgnoreMask,
        )
        mask = instancer.ComputeMaskAtTime(self._time)
        if len(places) != len(numbers):
            raise BadHouse(self._file, str(prim.GetPath()), "needs one transform per instance")
        for k, (number, place) in enumerate(zip(numbers, places, strict=True)):
            prototype = self._stage.GetPrimAtPath(paths[int(number)])
            if not prototype or (len(mask) and not mask[k]):
                continue
            name = prototype.GetName()
            own_above = self._node(prototype, holder, np.array(place), name, f"{path}/{name}.{k}")
            yield from ((child, own_above) for child in _children(prototype))


def _children(prim: Any) -> list[Any]:
    return list(prim.GetFilteredChildren(Usd.TraverseInstanceProxies()))


def _visible_children(prim: Any) -> list[Any]:
    return list(Usd.PrimRange(prim, Usd.TraverseInstanceProxies()))[1:2000]


def _is_hidden(prim: Any) -> bool:
    imageable = UsdGeom.Imageable(prim)
    if not imageable:
        return False
    if imageable.GetVisibilityAttr().Get(Usd.TimeCode.EarliestTime()) == UsdGeom.Tokens.invisible:
        return True
    return imageable.GetPurposeAttr().Get() in _SKIPPED_PURPOSES


def _is_no_place(prim: Any) -> bool:
    """True if a prim has no place: a material, a subset of faces, a camera."""
    if prim.IsA(UsdShade.NodeGraph) or prim.IsA(UsdShade.Shader):  # a material is a graph of nodes
        return True
    return bool(prim.IsA(UsdGeom.Subset) or prim.IsA(UsdGeom.Camera))


def _is_component(prim: Any) -> bool:
    return bool(Kind.Registry.IsA(Usd.ModelAPI(prim).GetKind(), Kind.Tokens.component))


def _holders(stage: Any) -> set[str]:
    """Paths of the prims that hold components, labels, lights or parts of the building."""
    holders: set[str] = set()
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        parent = prim.GetParent()
        if not parent or str(parent.GetPath()) in holders or _is_no_place(prim):
            continue
        cls = class_of_node_name(prim.GetName()) if prim.IsA(UsdGeom.Gprim) else None
        is_building = cls is not None and (cls.kind in _STRUCTURE or cls.kind is ItemKind.GROUND)
        is_light = prim.IsA(UsdLux.BoundableLightBase)
        if is_building or is_light or _is_component(prim) or _own_label(prim):
            while parent and str(parent.GetPath()) not in holders:
                holders.add(str(parent.GetPath()))
                parent = parent.GetParent()
    return holders


def _own_label(prim: Any) -> str:
    """The class that a prim is labelled with itself, "" where it is not."""
    for taxonomy in ("class", "category"):
        words = prim.GetAttribute(f"semantics:labels:{taxonomy}").Get()
        if words is not None and len(words):
            return str(next(iter(words)))[:100]
    for attribute in prim.GetAuthoredPropertiesInNamespace("semantic"):
        # The older schema: semantic:<name>:params:semanticType and semanticData.
        name = attribute.GetName()
        if name.endswith(":params:semanticType") and str(prim.GetAttribute(name).Get()) in (
            "class",
            "category",
        ):
            data = prim.GetAttribute(name.replace("semanticType", "semanticData")).Get()
            if data:
                return str(data)[:100]
    return ""


def _light_colour(prim: Any) -> tuple[tuple[float, float, float], bool]:
    """(linear colour, largest 1; whether the stage gives it)."""
    colour = prim.GetAttribute("inputs:color")
    has_temperature = bool(prim.GetAttribute("inputs:enableColorTemperature").Get())
    value = np.array(list(colour.Get() or (1, 1, 1)), np.float64)
    if has_temperature:
        kelvin = prim.GetAttribute("inputs:colorTemperature").Get() or 6500.0
        value = value * np.array(list(UsdLux.BlackbodyTemperatureAsRgb(float(kelvin))))
    if not np.isfinite(value).all() or value.max() <= 0:
        return (1.0, 1.0, 1.0), False
    r, g, b = (round(float(c), 4) for c in np.maximum(value, 0) / value.max())
    return (r, g, b), has_temperature or colour.HasAuthoredValue()


def _item_id(path: str) -> str:
    return path[-_MOST_ID:]
