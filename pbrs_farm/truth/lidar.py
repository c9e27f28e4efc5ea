"""Scans of laser scanners: end points of beams, with their item and path; no effects.

A beam passes straight through panes and glass, and is reflected by mirrors: the hit is then reported at its
virtual position behind the mirror, as scanners do. The scanner's axes are x forward, y left, z up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, Matrix4
from pbrs_farm.core.house import Geometry, House, MaterialKind
from pbrs_farm.core.mesh import triangle_corners, unit_normals
from pbrs_farm.truth.standard_layers import nyu40_of_instance
from pbrs_farm.truth.surface_layers import albedo_of_points

GLASS_TRANSMISSION: Final = 0.96
"""Share of a beam that goes through a face of clear glass: 4 % are mirrored there."""
MIRROR_REFLECTANCE: Final = 0.9
"""Share of a beam that a mirror turns back."""
_MOST_TURNS: Final = 8  # faces of glass and mirrors that a beam is followed through
_CLEAR_M: Final = 1e-4  # off a surface, where the next part of a beam starts


@dataclass(frozen=True, slots=True)
class LidarSensor:
    """A scanner by its data sheet; all beams of a turn are measured simultaneously.

    elevations_deg: of its rings, upwards. step_deg: between beams of a ring. noise_m: standard deviation of
    a range, plus noise_share of the range.
    """

    title: str
    elevations_deg: tuple[float, ...]
    step_deg: float
    nearest_m: float
    farthest_m: float
    noise_m: float
    noise_share: float = 0.0

    @property
    def n_beams(self) -> int:
        """Of a turn, all rings together."""
        return len(self.elevations_deg) * round(360 / self.step_deg)

    def directions(self) -> F64:
        """(n_beams, 3) unit, ring by ring, each from forward to the left."""
        azimuth = np.radians(np.arange(round(360 / self.step_deg)) * self.step_deg)
        up = np.radians(np.array(self.elevations_deg))[:, None]
        level = np.cos(up) * np.stack([np.cos(azimuth), np.sin(azimuth)])[:, None]
        height = np.broadcast_to(np.sin(up), level.shape[1:])
        return np.asarray(np.stack([*level, height], axis=-1).reshape(-1, 3))


def _spread(low: float, high: float, n: int) -> tuple[float, ...]:
    return tuple(float(v) for v in np.linspace(low, high, n))


LIDARS: Final[Mapping[str, LidarSensor]] = {
    "rplidar_a1": LidarSensor("Slamtec RPLIDAR A1", (0.0,), 1.0, 0.15, 12.0, 0.0, 0.005),
    "rplidar_a3": LidarSensor("Slamtec RPLIDAR A3", (0.0,), 0.225, 0.2, 25.0, 0.0, 0.005),
    "vlp16": LidarSensor("Velodyne VLP-16, 10 Hz", _spread(-15, 15, 16), 0.2, 0.5, 100.0, 0.015),
    "hdl32": LidarSensor(
        "Velodyne HDL-32E, 10 Hz", _spread(-30.67, 10.67, 32), 0.16, 1.0, 100.0, 0.01
    ),
    "hdl64": LidarSensor(
        "Velodyne HDL-64E, 10 Hz", _spread(-24.8, 2.0, 64), 0.18, 0.9, 120.0, 0.01
    ),
    "os1_64": LidarSensor(
        "Ouster OS1-64, 1024 x 10", _spread(-22.5, 22.5, 64), 0.3515625, 0.3, 120.0, 0.015
    ),
}
"""Scanners by name. Accuracies given as +-2 s are stored as s."""


class FirstHits(Protocol):
    """The part of a caster that a scan uses; raycast/caster.py is one."""

    geometry: Geometry

    def first_hit(self, origins: F64, directions: F64) -> tuple[F32, I32]:
        """Distance and face of each ray, inf and -1 for none."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class LidarScan:
    """The beams of one turn that came back, in the scanner's axes."""

    points: F64  # (N, 3) metres: direction times measured range
    range_m: F64  # (N,) as measured
    true_range_m: F64  # (N,) length of the beam's path
    intensity: F64  # (N,) 0..1: reflectance x cosine x what glass and mirrors leave, both ways
    ring: NDArray[np.uint16]  # (N,)
    instance: NDArray[np.uint16]  # (N,) of what sent the light back
    label: NDArray[np.uint16]  # (N,) its NYU40 class
    normals: F64  # (N, 3) unit, towards the scanner; mirrored as the point is
    through: NDArray[np.uint8]  # (N,) faces of glass on the way
    mirrored: NDArray[np.uint8]  # (N,) mirrors on the path: above 0 the point is virtual
    via: NDArray[np.uint16]  # (N,) instance of the first pane or mirror on the way, 0 = none


@dataclass(slots=True, eq=False)
class _Beams:
    """Beams in flight, changed in place."""

    origin: F64  # (N, 3) world
    direction: F64  # (N, 3) unit, world
    unfold: F64  # (N, 3, 3) from the world as mirrors show it back to where it seems to be
    path_m: F64
    left: F64  # share of the light, one way
    through: NDArray[np.uint8]
    mirrored: NDArray[np.uint8]
    via: NDArray[np.uint16]


def lidar_scan(
    caster: FirstHits,
    house: House,
    world_from_scanner: Matrix4,
    sensor: LidarSensor,
    textures: Mapping[str, NDArray[np.uint8]],
    *,
    seed: int,
) -> LidarScan:
    """Scan a house from a pose (4, 4, rigid).

    textures: as of LabelInputs. Equal seeds give equal noise. Not modelled: rain, sunlight, beam width,
    returns from panes themselves, dark surfaces with too weak returns.
    """
    turn, directions = world_from_scanner[:3, :3], sensor.directions()
    n = len(directions)
    beams = _Beams(
        np.tile(world_from_scanner[:3, 3], (n, 1)),
        directions @ turn.T,
        np.tile(np.eye(3), (n, 1, 1)),
        np.zeros(n),
        np.ones(n),
        np.zeros(n, np.uint8),
        np.zeros(n, np.uint8),
        np.zeros(n, np.uint16),
    )
    face = _followed(beams, caster, house, sensor.farthest_m)
    back = np.flatnonzero((face >= 0) & (beams.path_m >= sensor.nearest_m))
    face = face[back]
    normal = _normals(caster.geometry, face, beams.direction[back])
    albedo = _reflectance(caster.geometry, house, textures, face, beams.origin[back])
    cosine = np.abs((normal * beams.direction[back]).sum(1))
    rng = np.random.default_rng(seed)
    true = beams.path_m[back]
    noise = sensor.noise_m + sensor.noise_share * true
    measured = np.maximum(true + rng.normal(0.0, 1.0, n)[back] * noise, 0)
    instance = caster.geometry.face_item[face].astype(np.uint16)
    seeming = np.einsum("nij,nj->ni", beams.unfold[back], normal)
    n_azimuths = n // len(sensor.elevations_deg)
    return LidarScan(
        directions[back] * measured[:, None],
        measured,
        true,
        albedo * cosine * beams.left[back] ** 2,
        (back // n_azimuths).astype(np.uint16),
        instance,
        nyu40_of_instance(house)[instance].astype(np.uint16),
        seeming @ turn,
        beams.through[back],
        beams.mirrored[back],
        beams.via[back],
    )


def _followed(beams: _Beams, caster: FirstHits, house: House, farthest_m: float) -> I32:
    """(N,) the face at the end of each beam, -1 beyond the range; moves the beams there."""
    geometry = caster.geometry
    kinds = [material.kind for material in house.materials]
    is_glass = np.array([kind in (MaterialKind.PANE, MaterialKind.GLASS) for kind in kinds])
    is_mirror = np.array([kind is MaterialKind.MIRROR for kind in kinds])
    ends, on = np.full(len(beams.path_m), -1, np.int32), np.arange(len(beams.path_m))
    for _turn in range(_MOST_TURNS + 1):
        _t, face = caster.first_hit(beams.origin[on], beams.direction[on])
        on, face = on[face >= 0], face[face >= 0]
        step = _distances(geometry, face, beams.origin[on], beams.direction[on])
        beams.path_m[on] += step
        beams.origin[on] += step[:, None] * beams.direction[on]
        on, face = on[(near := beams.path_m[on] <= farthest_m)], face[near]
        material = geometry.face_material[face]
        turned, passed = is_mirror[material], is_glass[material]
        ends[on[~(turned | passed)]] = face[~(turned | passed)]
        _turn_back(beams, on[turned], face[turned], geometry)
        _pass(beams, on[passed], face[passed], geometry)
        on = on[turned | passed]
        if not len(on):
            break
        beams.origin[on] += _CLEAR_M * beams.direction[on]
        beams.path_m[on] += _CLEAR_M
    return ends


def _turn_back(beams: _Beams, rays: NDArray[np.intp], face: I32, geometry: Geometry) -> None:
    normal = _normals(geometry, face, beams.direction[rays])
    mirror = np.eye(3) - 2 * normal[:, :, None] * normal[:, None, :]
    beams.direction[rays] = np.einsum("nij,nj->ni", mirror, beams.direction[rays])
    beams.unfold[rays] = beams.unfold[rays] @ mirror
    beams.left[rays] *= MIRROR_REFLECTANCE
    beams.mirrored[rays] += 1
    _note_first(beams, rays, face, geometry)


def _pass(beams: _Beams, rays: NDArray[np.intp], face: I32, geometry: Geometry) -> None:
    beams.left[rays] *= GLASS_TRANSMISSION
    beams.through[rays] += 1
    _note_first(beams, rays, face, geometry)


def _note_first(beams: _Beams, rays: NDArray[np.intp], face: I32, geometry: Geometry) -> None:
    first = beams.via[rays] == 0
    beams.via[rays[first]] = geometry.face_item[face[first]]


def _distances(geometry: Geometry, face: I32, origin: F64, direction: F64) -> F64:
    """(N,) along unit directions to the plane of each face, in double precision."""
    corners = triangle_corners(geometry.positions, geometry.faces[face])
    normal = unit_normals(corners)
    along = (normal * direction).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        distances = (normal * (corners[:, 0] - origin)).sum(1) / along
    return np.asarray(np.where(np.isfinite(distances), np.maximum(distances, 0), 0), np.float64)


def _normals(geometry: Geometry, face: I32, direction: F64) -> F64:
    """(N, 3) unit normals of faces, turned against the directions."""
    normal = unit_normals(triangle_corners(geometry.positions, geometry.faces[face]))
    return np.asarray(np.where((normal * direction).sum(1, keepdims=True) > 0, -normal, normal))


def _reflectance(
    geometry: Geometry,
    house: House,
    textures: Mapping[str, NDArray[np.uint8]],
    face: I32,
    points: F64,
) -> F64:
    """(N,) share of infrared light that a surface sends back: dyes are bright there, so its brightest channel."""
    corners = triangle_corners(geometry.positions, geometry.faces[face])
    weights = _barycentric(corners, points)
    uv = (geometry.uvs[geometry.faces[face]].astype(np.float64) * weights[..., None]).sum(1)
    albedo = albedo_of_points(face, uv.astype(np.float32), house, geometry, textures)
    return np.asarray(np.clip(albedo.max(1, initial=0), 0, 1), np.float64)


def _barycentric(corners: F64, points: F64) -> F64:
    """(N, 3) weights of a triangle's corners at points of its plane."""
    a, b, p = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (a * a).sum(1), (a * b).sum(1), (b * b).sum(1)
    pa, pb = (p * a).sum(1), (p * b).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        area = aa * bb - ab * ab
        v, w = (bb * pa - ab * pb) / area, (aa * pb - ab * pa) / area
    return np.asarray(np.nan_to_num(np.stack([1 - v - w, v, w], axis=1)), np.float64)
