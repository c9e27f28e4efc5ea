"""Radiant exitance of the faces near each bulb, by which guiding targets are chosen; no effects."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I64
from pbrs_farm.core.frames import LM_PER_W, LUMINANCE
from pbrs_farm.core.mesh import face_areas, triangle_bounds, triangle_corners, unit_normals
from pbrs_farm.transport.illuminance import radiosity
from pbrs_farm.transport.kernels.device_scene import DeviceScene
from pbrs_farm.transport.kernels.emitters import Emitters
from pbrs_farm.transport.kernels.guiding_targets import BACK_SIDE, GuidingTargets, no_targets
from pbrs_farm.transport.scene_tables.material_rows import F0, KD, KIND, SURFACE, TAU
from pbrs_farm.transport.scene_tables.scene_tables import NO_LAMP, SceneTables, bounding_spheres

INTERIOR_REACH_M: Final = 0.6  # faces farther from a bulb are outside its lamp's interior

# Of the lamp's flux, per m2: as much light as falls on a surface 40 cm from a bare bulb.
MIN_EXITANCE: Final = 0.5

# Share of the flux of a lamp's targets inside the sphere called its interior.
INTERIOR_SHARE: Final = 0.9

_MAX_FACES: Final = 1024  # candidates per lamp
_POINTS: Final = 4  # on either side of a face
_SPP: Final = 4  # paths from each point, to the face's own lamp alone
_DEPTH: Final = 3


def guiding_targets(
    scene: DeviceScene, emitters: Emitters, tables: SceneTables, seed: int
) -> GuidingTargets:
    """The face sides near each lamp that send out more of its light than MIN_EXITANCE.

    Estimated by rays from the faces, repeatable by the seed. `no_targets` where no face is a
    candidate.
    """
    faces, lamps = _candidates(tables)
    if not len(faces):
        return no_targets(len(tables.lamps))

    # Keep sufficiently bright sides, ordered by lamp.
    flux = np.array([lamp.flux_lm for lamp in tables.lamps])
    areas = face_areas(_corners_of_faces(tables, faces))
    lumens = _exitance(scene, emitters, tables, faces, lamps, seed) * LM_PER_W
    keep = np.flatnonzero((lumens > MIN_EXITANCE * flux[lamps]).ravel())
    keep = keep[np.argsort(np.tile(lamps, 2)[keep], kind="stable")]
    sides = np.concatenate([faces, faces + BACK_SIDE])[keep]
    lamp, area = np.tile(lamps, 2)[keep], np.tile(areas, 2)[keep]
    power = (lumens * areas).ravel()[keep]

    # Draw them in proportion to the light they send out.
    total = np.bincount(lamp, power, len(flux))
    probabilities = power / total[lamp]
    return GuidingTargets(
        sides=sides.astype(np.uint32),
        probabilities=probabilities,
        pdfs=probabilities / area,
        first=np.searchsorted(lamp, np.arange(len(flux) + 1)),
        shares=np.clip(total / np.maximum(flux, 1e-9), 0, 1),
        interiors=_lamp_interiors(tables, sides & (BACK_SIDE - 1), lamp, probabilities),
    )


def _lamp_interiors(tables: SceneTables, faces: I64, lamps: I64, probabilities: F64) -> F64:
    """(L, 4) spheres around each bulb that hold INTERIOR_SHARE of what its faces send out."""
    spheres = bounding_spheres(tables)
    reach = np.linalg.norm(_corners_of_faces(tables, faces) - spheres[lamps, None, :3], axis=2).max(
        1
    )
    for k, bulb_m in enumerate(spheres[:, 3].tolist()):
        # Take the lamp's faces from the nearest on until the share is reached.
        rows = np.flatnonzero(lamps == k)
        rows = rows[np.argsort(reach[rows], kind="stable")]
        last = np.searchsorted(np.cumsum(probabilities[rows]), INTERIOR_SHARE)
        spheres[k, 3] = max(reach[rows][last], 1.2 * bulb_m) if len(rows) else 0
    return spheres


class FacePdfs(NamedTuple):
    """Pdfs of guided rays for each face, one row per face."""

    faces: NDArray[np.uint32]
    front: F32  # per m2
    back: F32
    lamps: NDArray[np.uint32]


def pdfs_by_face(targets: GuidingTargets) -> FacePdfs:
    """The targets' pdfs, the two sides of a face together."""
    faces, row = np.unique(targets.sides & np.uint32(BACK_SIDE - 1), return_inverse=True)
    lamps = np.zeros(len(faces), np.uint32)
    lamps[row] = np.searchsorted(targets.first, np.arange(len(row)), side="right") - 1
    values = np.zeros((2, len(faces)), np.float32)
    values[(targets.sides >= BACK_SIDE).astype(int), row] = targets.pdfs
    return FacePdfs(faces, values[0], values[1], lamps)


def _corners_of_faces(tables: SceneTables, faces: I64) -> F64:
    return triangle_corners(tables.positions, tables.faces[faces])


def _candidates(tables: SceneTables) -> tuple[I64, I64]:
    """(faces that scatter and lie near a lamp, the nearest lamp of each)."""
    tag = tables.face_tags
    scatters = tables.material_rows[tag & 0xFFFF, KIND] == SURFACE
    faces = np.flatnonzero(scatters & ((tag >> 16) == NO_LAMP))
    corners = tables.positions[tables.faces[faces]]
    bounds = triangle_bounds(corners.astype(np.float64))
    low, high = (np.ascontiguousarray(b.T) for b in bounds)
    nearest = np.full(len(faces), np.inf)
    lamps = np.zeros(len(faces), np.int64)
    for k, sphere in enumerate(bounding_spheres(tables)):
        # Measure from the bulb to corners and centre, of the faces in its bounding box alone.
        centre, radius = sphere[:3], sphere[3]
        reach = INTERIOR_REACH_M + radius
        in_box = np.ones(len(faces), np.bool_)
        for axis in range(3):
            in_box &= low[axis] >= centre[axis] - reach
            in_box &= high[axis] <= centre[axis] + reach
        within = np.flatnonzero(in_box)
        places = np.concatenate([corners[within], corners[within].mean(1, keepdims=True)], 1)
        from_bulb = np.linalg.norm(places - centre, axis=2)
        distance = np.maximum(from_bulb.min(1) - radius, 0)
        closer = (from_bulb.max(1) <= reach) & (distance < nearest[within])
        lamps[within[closer]] = k
        nearest[within[closer]] = distance[closer]
    near = np.isfinite(nearest)
    # Keep the faces that look largest from their lamp, should there be very many.
    faces, lamps = faces[near], lamps[near]
    size = face_areas(_corners_of_faces(tables, faces)) / np.maximum(nearest[near], 0.02) ** 2
    largest = np.sort(np.argsort(-size, kind="stable")[: _MAX_FACES * max(len(tables.lamps), 1)])
    return faces[largest], lamps[largest]


def _exitance(
    scene: DeviceScene, emitters: Emitters, tables: SceneTables, faces: I64, lamps: I64, seed: int
) -> F64:
    """(2, K) W m-2 of luminance that the fronts and the backs of faces send out, by their lamp."""
    # Choose points uniform over each face, the same for front and back.
    rng = np.random.default_rng(seed)
    corners = _corners_of_faces(tables, faces)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = unit_normals(corners)
    uv = np.sort(rng.random((_POINTS, len(faces), 2)), axis=2)
    a, b = uv[..., :1], uv[..., 1:] - uv[..., :1]
    points = corners[:, 0] + a * e1 + b * e2
    points = np.tile(points, (2, 1, 1)).reshape(-1, 3)
    normals = np.stack([normal, -normal])[:, None].repeat(_POINTS, 1).reshape(-1, 3)
    # Trace the light of the face's own lamp to them; reflect it, and let it through.
    own_lamps = np.tile(lamps, 2 * _POINTS)
    _outdoor, indoor = radiosity(
        scene, emitters, points, normals, _SPP, seed, lamps=own_lamps, max_depth=_DEPTH
    )
    irradiance = np.pi * (indoor @ LUMINANCE).reshape(2, _POINTS, len(faces)).mean(1)
    rows = tables.material_rows[tables.face_tags[faces] & 0xFFFF]
    reflected, through = (rows[:, KD] + rows[:, F0]) @ LUMINANCE, rows[:, TAU] @ LUMINANCE
    return np.asarray(reflected * irradiance + through * irradiance[::-1])
