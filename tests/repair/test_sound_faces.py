"""Faces opposite to their shading normals are flipped, unless that opens a closed mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import edges_are_paired
from pbrs_farm.geometry.solids import box
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.repair.small_repairs import with_sound_faces


def cube() -> Surface:
    """A cube with eight corners, each with the mean normal of its faces."""
    surface = box("cube", np.zeros(3), np.full(3, 0.5), 0)
    corners, numbers = np.unique(surface.positions, axis=0, return_inverse=True)
    faces = numbers.reshape(-1)[surface.faces].astype(np.int32)
    normals = (corners / np.linalg.norm(corners, axis=1, keepdims=True)).astype(np.float32)
    return replace(surface, positions=corners, faces=faces, uvs=None, normals=normals)


def repaired(surface: Surface) -> Surface:
    home = builtin_home()
    item = replace(home.items[-1], surfaces=(surface,), lights=())
    house, _report = with_sound_faces(home.with_items([*home.items[:-1], item]))
    return house.items[-1].surfaces[0]


@pytest.mark.parametrize("is_closed", [True, False])
def test_single_faces_of_a_closed_mesh_stay(is_closed: bool) -> None:
    surface = cube()
    assert surface.normals is not None
    if not is_closed:
        surface = replace(surface, faces=surface.faces[1:])
    # Reverse the normals at the corners of one face, like smooth normals of sharp meshes.
    normals = surface.normals.copy()
    normals[surface.faces[3]] *= -1
    after = repaired(replace(surface, normals=normals))
    assert np.array_equal(after.faces, surface.faces) == is_closed
    assert edges_are_paired(after.faces) == is_closed


def test_a_closed_mesh_that_is_inside_out_is_turned_whole() -> None:
    surface = cube()
    after = repaired(replace(surface, faces=surface.faces[:, ::-1].copy()))
    assert edges_are_paired(after.faces)
    assert {frozenset(f) for f in after.faces.tolist()} == {
        frozenset(f) for f in surface.faces.tolist()
    }
    assert not np.array_equal(after.faces, surface.faces[:, ::-1])
