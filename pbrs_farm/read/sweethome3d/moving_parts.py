"""Doors, drawers and panes of a model, moved as the home keeps them; no effects.

A transformation names a hinge or rail ("sweethome3d_hinge_1"); it moves every group that says it
hangs on it ("sweethome3d_opening_on_hinge_1", "sweethome3d_window_pane_on_hinge_1_left").
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.read.mesh.obj import Mesh

_JOINT = re.compile(r"(?:^|_)((?:hinge|rail)_\d+|unique_rail)(?:_|$)")

HINGE = "sweethome3d_hinge_"
_FIXED = (HINGE, "sweethome3d_rail_", "sweethome3d_unique")
Transformations = tuple[tuple[str, tuple[float, ...]], ...]  # (name, 12 numbers)


def joint_of(name: str) -> str:
    """The joint a transformation or a group names: "hinge_1", "rail_2", "unique_rail", or ""."""
    found = _JOINT.search(name)
    return found[1] if found else ""


def moved(meshes: tuple[Mesh, ...], transformations: Transformations) -> tuple[Mesh, ...]:
    """The meshes with those on a moved joint moved; matrices are 3 x 4, row by row."""
    by_joint = {joint_of(name): matrix for name, matrix in transformations if joint_of(name)}
    return tuple(_moved(mesh, by_joint) for mesh in meshes)


def _moved(mesh: Mesh, by_joint: dict[str, tuple[float, ...]]) -> Mesh:
    for word in mesh.group.split():
        # The hinge or rail itself stays where it is.
        is_fixed = word.startswith(_FIXED)
        joint = "" if is_fixed else joint_of(word)
        if joint == "" and word.startswith("sweethome3d_") and "_on_rail" in word:
            joint = "unique_rail"
        if joint not in by_joint:
            continue
        return _transformed(mesh, np.array(by_joint[joint]).reshape(3, 4))
    return mesh


def hangs_on(mesh: Mesh, joints: frozenset[str]) -> bool:
    """Whether a mesh is moved by one of some joints; the hinge or rail itself is not."""
    words = mesh.group.split()
    return any(joint_of(w) in joints and not w.startswith(_FIXED) for w in words)


def _transformed(mesh: Mesh, matrix: F64) -> Mesh:
    """The mesh moved by a 3 x 4 matrix; as it is where the matrix flattens it."""
    linear = matrix[:, :3]
    if abs(np.linalg.det(linear)) < 1e-9:
        return mesh
    # Normals take the inverse transpose; a mirror turns the faces over.
    normals = mesh.normals @ np.linalg.inv(linear)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0, length, 1)
    faces = mesh.faces if np.linalg.det(linear) > 0 else mesh.faces[:, [0, 2, 1]]
    positions = mesh.positions @ linear.T + matrix[:, 3]
    return replace(mesh, positions=positions, normals=normals, faces=faces)
