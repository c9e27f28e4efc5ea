"""Measures of a repaired shell: closedness, coinciding faces, visible surfaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.house import House, geometry_from_house
from pbrs_farm.core.mesh import face_areas, triangle_corners, unit_normals
from tests.repair.embree import EmbreeOccluder

F64 = NDArray[np.float64]


def structure_of(house: House) -> House:
    """The house without its furniture."""
    return house.with_items(i for i in house.items if i.kind.is_structure)


def unpaired_edges(house: House) -> F64:
    """(N,) lengths of the structure's edges without a twin in the other direction."""
    g = geometry_from_house(structure_of(house))
    points, corner = np.unique(g.positions, axis=0, return_inverse=True)
    f = np.ravel(corner)[g.faces]
    edges = np.concatenate([f[:, [0, 1]], f[:, [1, 2]], f[:, [2, 0]]]).astype(np.int64)
    n = len(points)
    forth, back = edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0]
    keys, counts = np.unique(np.concatenate([forth, back]), return_counts=True)
    forward = np.searchsorted(np.sort(forth), keys, "right") - np.searchsorted(np.sort(forth), keys)
    alone = keys[2 * forward != counts]
    return np.asarray(np.linalg.norm(points[alone // n] - points[alone % n], axis=1), np.float64)


def rays_from(origin: tuple[float, float, float], n: int = 20_000) -> tuple[F64, F64]:
    """n rays in all directions."""
    directions = np.random.default_rng(5).normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.tile(np.array(origin), (n, 1)), directions


def seen_from(house: House, origin: tuple[float, float, float]) -> dict[tuple[str, str], int]:
    """(item id, surface name) -> number of rays that hit it first, of the structure only; "" = the sky."""
    shell = structure_of(house)
    g = geometry_from_house(shell)
    names = [(item.id, s.name) for _, item, _, s in shell.surfaces()]
    origins, directions = rays_from(origin)
    _, face = EmbreeOccluder(shell).first_hit(
        origins.astype(np.float32), directions.astype(np.float32)
    )
    n_hits: dict[tuple[str, str], int] = {}
    for number in np.where(face < 0, -1, g.face_surface[face]).tolist():
        key = names[number] if number >= 0 else ("", "")
        n_hits[key] = n_hits.get(key, 0) + 1
    return n_hits  # fmt: skip


def coinciding_share(house: House, origin: tuple[float, float, float]) -> float:
    """Share of rays from origin with a second face within half a millimetre behind the first.

    Where faces coincide it is their share of the view; at edges seen from outside it is a sliver.
    """
    shell = structure_of(house)
    occluder = EmbreeOccluder(shell)
    g = geometry_from_house(shell)
    normals = unit_normals(triangle_corners(g.positions, g.faces))
    origins, directions = rays_from(origin)
    first, face = occluder.first_hit(origins.astype(np.float32), directions.astype(np.float32))
    hit = (face >= 0) & ((directions * normals[face]).sum(1) < -0.2)
    start = (origins + directions * (first[:, None] + 2e-5))[hit]
    second, _ = occluder.first_hit(start.astype(np.float32), directions[hit].astype(np.float32))
    return float((second < 5e-4).mean())


def leaning_area(house: House) -> float:
    """Area in square metres of the structure's oblique faces, without slivers."""
    area = 0.0
    for item in structure_of(house).items:
        for s in item.surfaces:
            up = np.abs(unit_normals(triangle_corners(s.positions, s.faces))[:, 1])
            sizes = face_areas(triangle_corners(s.positions, s.faces))
            area += float(sizes[(up > 0.01) & (up < 0.9999) & (sizes > 1e-4)].sum())
    return area
