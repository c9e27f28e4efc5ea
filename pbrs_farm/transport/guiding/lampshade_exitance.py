"""How much light the faces near a bulb send out: what guided rays aim at (guide.py); no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.mesh import face_areas, triangle_corners, unit_normals
from pbrs_farm.transport.guiding.guiding_targets import BACK, GlowTables, no_glow
from pbrs_farm.transport.illuminance import radiosity
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.scene_tables.material_rows import SURFACE
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP, SceneTables, bounding_spheres

REACH_M: Final = 0.6
"""Faces farther from a bulb are no lamp's inside."""

MIN_EXITANCE: Final = 0.5
"""Of the lamp's flux, per m2: as much light as falls on a surface 40 cm from a bare bulb."""

INSIDE: Final = 0.9

_MAX_FACES: Final = 1024
_POINTS: Final = 4
_SPP: Final = 4
_DEPTH: Final = 3


def glow_tables(
    scene: DeviceScene, emitters: Emitters, tables: SceneTables, seed: int
) -> GlowTables:
    """The face sides near each lamp that send out more of its light than MIN_EXITANCE.

    4 points on either side of each face, 4 paths each to its lamp alone.
    """
    faces, lamps = _candidates(tables)
    if not len(faces):
        return no_glow(len(tables.lamps))

    flux = np.array([lamp.flux_lm for lamp in tables.lamps])
    areas = face_areas(_corners(tables, faces))
    lumens = _exitance(scene, emitters, tables, faces, lamps, seed) * LM_PER_W
    keep = (lumens > MIN_EXITANCE * flux[lamps]).ravel()
    power = (lumens * areas).ravel()[keep]
    sides = np.concatenate([faces, faces + BACK])[keep]
    lamp = np.tile(lamps, 2)[keep]
    order = np.argsort(lamp, kind="stable")
    sides, lamp, power, area = (
        sides[order],
        lamp[order],
        power[order],
        np.tile(areas, 2)[keep][order],
    )

    total = np.bincount(lamp, power, len(flux))
    chances = power / total[lamp]
    first = np.searchsorted(lamp, np.arange(len(flux) + 1))
    shares = np.clip(total / np.maximum(flux, 1e-9), 0, 1)
    balls = _insides(tables, sides & (BACK - 1), lamp, chances)
    return GlowTables(sides.astype(np.uint32), chances, chances / area, first, shares, balls)


def _insides(
    tables: SceneTables,
    faces: NDArray[np.int64],
    lamps: NDArray[np.int64],
    chances: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(L, 4) balls around each bulb with INSIDE of what its faces send out."""
    balls = bounding_spheres(tables)
    reach = np.linalg.norm(_corners(tables, faces) - balls[lamps, None, :3], axis=2).max(1)
    for k, bulb_m in enumerate(balls[:, 3].tolist()):
        mine = np.flatnonzero(lamps == k)
        mine = mine[np.argsort(reach[mine], kind="stable")]
        inside = np.searchsorted(np.cumsum(chances[mine]), INSIDE)
        balls[k, 3] = max(reach[mine][inside], 1.2 * bulb_m) if len(mine) else 0
    return balls


def pdfs_by_face(
    glow: GlowTables,
) -> tuple[NDArray[np.uint32], NDArray[np.float32], NDArray[np.float32], NDArray[np.uint32]]:
    """(faces, pdfs of their fronts, of their backs, lamps), a row a face."""
    faces, row = np.unique(glow.sides & np.uint32(BACK - 1), return_inverse=True)
    lamps = np.zeros(len(faces), np.uint32)
    lamps[row] = np.searchsorted(glow.first, np.arange(len(row)), side="right") - 1
    values = np.zeros((2, len(faces)), np.float32)
    values[(glow.sides >= BACK).astype(int), row] = glow.pdfs
    return faces, values[0], values[1], lamps


def _corners(tables: SceneTables, faces: NDArray[np.int64]) -> NDArray[np.float64]:
    return triangle_corners(tables.positions, tables.faces[faces])


def _candidates(tables: SceneTables) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(faces that scatter and lie near a lamp, the nearest lamp of each)."""
    tag = tables.face_tags
    scatters = tables.material_rows[tag & 0xFFFF, 11] == SURFACE
    faces = np.flatnonzero(scatters & ((tag >> 16) == NO_LAMP))
    corners = tables.positions[tables.faces[faces]]
    low, high = corners.min(1), corners.max(1)
    nearest = np.full(len(faces), np.inf)
    lamps = np.zeros(len(faces), np.int64)
    for k, ball in enumerate(bounding_spheres(tables)):
        reach = REACH_M + ball[3]
        in_box = (low >= ball[:3] - reach).all(1) & (high <= ball[:3] + reach).all(1)
        within = np.flatnonzero(in_box)
        places = np.concatenate([corners[within], corners[within].mean(1, keepdims=True)], 1)
        from_bulb = np.linalg.norm(places - ball[:3], axis=2)
        distance = np.maximum(from_bulb.min(1) - ball[3], 0)
        closer = (from_bulb.max(1) <= reach) & (distance < nearest[within])
        lamps[within[closer]] = k
        nearest[within[closer]] = distance[closer]
    near = np.isfinite(nearest)
    # Take the faces that look largest from their lamp, should there be very many.
    faces, lamps = faces[near], lamps[near]
    size = face_areas(_corners(tables, faces)) / np.maximum(nearest[near], 0.02) ** 2
    kept = np.sort(np.argsort(-size, kind="stable")[: _MAX_FACES * max(len(tables.lamps), 1)])
    return faces[kept], lamps[kept]


def _exitance(
    scene: DeviceScene,
    emitters: Emitters,
    tables: SceneTables,
    faces: NDArray[np.int64],
    lamps: NDArray[np.int64],
    seed: int,
) -> NDArray[np.float64]:
    """(2, K) W m-2 of luminance that the fronts and the backs of faces send out, by their lamp."""
    rng = np.random.default_rng(seed)
    corners = _corners(tables, faces)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = unit_normals(corners)
    uv = np.sort(rng.random((_POINTS, len(faces), 2)), axis=2)
    a, b = uv[..., :1], uv[..., 1:] - uv[..., :1]
    points = corners[:, 0] + a * e1 + b * e2
    points = np.tile(points, (2, 1, 1)).reshape(-1, 3)
    normals = np.stack([normal, -normal])[:, None].repeat(_POINTS, 1).reshape(-1, 3)
    asked = np.tile(lamps, 2 * _POINTS)
    _outdoor, indoor = radiosity(
        scene, emitters, points, normals, _SPP, seed, lamps=asked, max_depth=_DEPTH
    )
    irradiance = np.pi * (indoor @ LUMINANCE).reshape(2, _POINTS, len(faces)).mean(1)
    rows = tables.material_rows[tables.face_tags[faces] & 0xFFFF]
    reflected, through = (rows[:, 0:3] + rows[:, 4:7]) @ LUMINANCE, rows[:, 8:11] @ LUMINANCE
    return np.asarray(reflected * irradiance + through * irradiance[::-1])
