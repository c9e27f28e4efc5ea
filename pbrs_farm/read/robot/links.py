"""Links of a robot -> nodes of a glTF document, with their joints. Effects: reads the files of models."""

from __future__ import annotations

import posixpath
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.joints import JointKind
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.common.source_files import RootFolder, SourceFiles
from pbrs_farm.read.gltf.assembly import Assembly, files_of_asset, gltf_of_groups
from pbrs_farm.read.gltf.scene_writer import KEY, joint_row, matrix_row
from pbrs_farm.read.mesh.mtl import ObjMaterial
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.mesh.shape import ball, cylinder_profile, shape_of_surface, turned
from pbrs_farm.read.robot.urdf import Robot, Solid, Visual

PLANE: Final = "plane"
RootsOf = Callable[[Visual], "list[int] | None"]
"""The model of a visual -> its root nodes; None without the file."""


def placed_links(
    built: Assembly, robot: Robot, roots_of: RootsOf, values: Mapping[str, float], scale: float
) -> dict[str, int]:
    """Link -> its node, below its parent's, with its joint (value, robot's scale); {} without a shape."""
    nodes = built.document.setdefault("nodes", [])
    # Nodes of assets come first: adding them moves the list on.
    shown: dict[str, list[tuple[list[int], F64]]] = {}
    for link in robot.links:
        for visual in link.visuals:
            if visual.solid is None:
                models = roots_of(visual)
            elif visual.solid.kind == PLANE:
                continue  # the ground
            else:
                models = solid_roots(built, visual.solid)
            if models is not None:
                shown.setdefault(link.name, []).append((models, visual.link_from_model))
    if not shown:
        return {}
    node_of: dict[str, int] = {}
    for link in robot.links:
        node: dict[str, Any] = {"name": "", "children": [], "extras": {}}
        if link.joint is not None:
            value = values.get(link.joint.name, 0.0)
            if link.joint.kind is JointKind.PRISMATIC:
                value /= scale
            node["matrix"] = matrix_row(link.joint.parent_from_link(value))
            if link.joint.kind is not None:
                limits = link.joint.lower, link.joint.upper
                axis, kind = link.joint.axis, link.joint.kind
                node["extras"] = {KEY: joint_row(link.name, kind, (0, 0, 0), axis, limits, value)}
        for models, matrix in shown.get(link.name, []):
            node["children"].append(built.node(models, matrix))
        node_of[link.name] = len(nodes)
        nodes.append(node)
        if link.parent is not None:
            nodes[node_of[link.parent]]["children"].append(node_of[link.name])
    return node_of


def roots_of_robot(robot: Robot, node_of: Mapping[str, int]) -> list[int]:
    """The nodes of its links without a parent."""
    return [node_of[link.name] for link in robot.links if link.parent is None]


def model_name(reference: str, folder: RootFolder, at: str) -> str:
    """Name below the root of a model that a file in folder `at` names (`package://x/y`: x/y or y)."""
    scheme, is_uri, path = reference.rpartition("://")
    if not is_uri:
        return folder.name_from(at, reference)
    if scheme == "file":
        return folder.name_from(at, path)
    paths = (path, path.partition("/")[2], f"models/{path}")
    names = [folder.name_from(start, p) for p in paths if p for start in (at, "")]
    return next((name for name in names if folder.path(name) is not None), names[0])


def files_of_robot(robot: Robot, folder: RootFolder, urdf: str, files: SourceFiles) -> set[str]:
    """Names below the root of the models that a URDF shows, and of what they name."""
    at = posixpath.dirname(urdf)
    models = {
        model_name(v.file, folder, at) for link in robot.links for v in link.visuals if v.file
    }
    existing = [model for model in models if folder.path(model) is not None]
    return {name for model in existing for name in files_of_asset(folder, model, files)}


def solid_roots(built: Assembly, solid: Solid) -> list[int]:
    """The root nodes of a box, cylinder or ball."""
    colour = ObjMaterial("solid", solid.rgba[:3], d=solid.rgba[3])
    if solid.kind == "box":
        shape = shape_of_surface(box("", np.zeros(3), np.array(solid.size) / 2, 0))
    elif solid.kind == "sphere":
        shape = ball(solid.size[0])
    else:
        shape = turned(cylinder_profile(solid.size[0], solid.size[1] / 2))
    points, faces, normals = shape.positions, shape.faces.astype(np.int32), shape.normals
    if normals is None:
        normals = np.zeros_like(points)
        normals[faces] = unit_normals(triangle_corners(points, faces))[:, None]
    mesh = Mesh("", colour.name, points, faces, None, normals)
    gltf = gltf_of_groups([("", [mesh])], {colour.name: colour}, np.eye(4), built.file)
    return built.added(str(solid), gltf)
