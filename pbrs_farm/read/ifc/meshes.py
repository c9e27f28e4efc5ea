"""Meshes of an IFC building's products by ifcopenshell, openings cut, in metres, z up; no effects."""

from __future__ import annotations

import multiprocessing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.mesh import closed_edge_share, signed_volume
from pbrs_farm.core.recipe import ReadFields

_MOST_THREADS: Final = 8
# Faceted shapes by the quick kernel (300,000 triangles in 8 s; in 170 s by the other), all else by
# the one that knows curves.
_KERNEL: Final = "hybrid-cgal-simple-opencascade"
_WELD_DECIMALS: Final = 6  # of metres: corners nearer than a micrometre are one


@dataclass(frozen=True, slots=True)
class Style:
    """How a part of a product looks."""

    name: str
    rgb: tuple[float, float, float] | None  # sRGB-encoded; None: the style has no colour
    transparency: float  # 0..1


@dataclass(frozen=True, slots=True, eq=False)
class ProductMesh:
    """Triangles of a product in its own frame."""

    positions: F64  # (V, 3)
    faces: I64  # (F, 3)
    style_of_face: I64  # (F,) index into styles, -1 = none
    styles: tuple[Style, ...]
    world_from_product: F64  # (4, 4), z up

    @property
    def world(self) -> F64:
        """(V, 3) corners in the world, z up."""
        return transform_points(self.world_from_product, self.positions)


def meshes_of_products(
    model: Any, products: Sequence[Any], file: str, fields: ReadFields
) -> dict[int, ProductMesh]:
    """Meshes by row number, without failed ones; BadHouse for more than read.max_triangles."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("no-normals", True)
    settings.set("apply-default-materials", False)
    settings.set("reorient-shells", True)
    settings.set("circle-segments", 16)
    meshes: dict[int, ProductMesh] = {}
    if not products:
        return meshes
    n_threads = min(multiprocessing.cpu_count(), _MOST_THREADS)
    iterator = ifcopenshell.geom.iterator(
        settings, model, n_threads, include=list(products), geometry_library=_KERNEL
    )
    if not iterator.initialize():
        return meshes
    n_faces = 0
    while True:
        shape = iterator.get()
        mesh = _mesh_of_shape(shape)
        if mesh is not None:
            n_faces += len(mesh.faces)
            place = f"#{shape.id} {shape.name}"[:80]
            if len(mesh.faces) > fields.max_model_triangles:
                text = f"more than {fields.max_model_triangles} triangles"
                raise BadHouse(file, place, text, hint="limit: read.max_model_triangles")
            if n_faces > fields.max_triangles:
                text = f"more than {fields.max_triangles} triangles"
                raise BadHouse(file, place, text, hint="limit: read.max_triangles")
            meshes[shape.id] = mesh
        if not iterator.next():
            return meshes


class Whole(NamedTuple):
    """A product without a shape, assembled from other products."""

    world_from_product: F64  # (4, 4), z up, metres
    parts: tuple[int, ...]  # numbers of their rows


def with_wholes(
    meshes: Mapping[int, ProductMesh], wholes: Mapping[int, Whole]
) -> dict[int, ProductMesh]:
    """The meshes by their rows' numbers, parts replaced by the products that they make."""
    united = dict(meshes)
    for number, whole in wholes.items():
        parts = [united.pop(p) for p in whole.parts if p in united]
        if not parts:
            continue
        own_from_world = np.asarray(np.linalg.inv(whole.world_from_product))
        positions = [transform_points(own_from_world, p.world) for p in parts]
        points = np.cumsum([0, *(len(p.positions) for p in parts)])
        styles = np.cumsum([0, *(len(p.styles) for p in parts)])
        united[number] = ProductMesh(
            np.concatenate(positions),
            np.concatenate([p.faces + k for p, k in zip(parts, points, strict=False)]),
            np.concatenate(
                [
                    np.where(p.style_of_face < 0, -1, p.style_of_face + k)
                    for p, k in zip(parts, styles, strict=False)
                ]
            ),
            tuple(style for p in parts for style in p.styles),
            whole.world_from_product,
        )
    return united


def _mesh_of_shape(shape: Any) -> ProductMesh | None:
    geometry = shape.geometry
    positions = np.asarray(geometry.verts, np.float64).reshape(-1, 3)
    faces = np.asarray(geometry.faces, np.int64).reshape(-1, 3)
    if not len(faces) or not np.isfinite(positions).all():
        return None
    styles = tuple(_style(row) for row in geometry.materials)
    numbers = np.asarray(geometry.material_ids, np.int64)
    if len(numbers) != len(faces):
        numbers = np.full(len(faces), -1)
    matrix = np.asarray(shape.transformation.matrix, np.float64).reshape(4, 4).T
    items = np.asarray(geometry.item_ids, np.int64)
    if len(items) != len(faces):
        items = np.zeros(len(faces), np.int64)
    return ProductMesh(positions, _facing_out(positions, faces, items), numbers, styles, matrix)


def _facing_out(positions: F64, faces: I64, items: I64) -> I64:
    """The faces, turned where a closed body (such as a mirrored mapped item) would face inwards."""
    turned = faces.copy()
    for item in np.unique(items):
        is_of_item = items == item
        corners = positions[faces[is_of_item]]
        # Ask for the sign first: nearly all bodies are sound.
        if signed_volume(corners, corners.reshape(-1, 3).mean(0)) >= 0:
            continue
        if closed_edge_share(np.round(corners, _WELD_DECIMALS)) == 1.0:
            turned[is_of_item] = faces[is_of_item][:, ::-1]
    return turned


def _style(row: Any) -> Style:
    colour = row.diffuse
    rgb = tuple(float(c) for c in getattr(colour, "components", colour)) if colour else ()
    is_given = len(rgb) == 3 and bool(np.isfinite(rgb).all())
    passes = float(row.transparency)
    clear = float(np.clip(passes, 0, 1)) if np.isfinite(passes) else 0.0
    r, g, b = (float(np.clip(c, 0, 1)) for c in rgb) if is_given else (0.0, 0.0, 0.0)
    return Style(str(row.name)[:100], (r, g, b) if is_given else None, clear)
