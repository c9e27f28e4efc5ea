"""Tracks of surface points through the frames of a film: position, and occlusion in each frame.

No effects of its own: rays are cast by the functions of each frame. A point moves with its face, and is chosen at a
pixel's centre of one of the film's frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, I64, Bools, FirstHit, HitRecord
from pbrs_farm.core.camera import Camera
from pbrs_farm.core.frames import transform_points
from pbrs_farm.truth.optical_flow import inside_picture, points_of_pixels, project_points, reaches

MOST_POINTS: Final = 2048
_QUERY_FRAMES: Final = 8  # spread over the film, in which points are chosen
_MOVING_SHARE: Final = 0.5  # share of points on visible moving surfaces


@dataclass(frozen=True, slots=True, eq=False)
class TrackFrame:
    """One frame of a film."""

    camera: Camera  # at the picture's size
    time_s: float
    hit: Callable[[], HitRecord]
    first_hit: Callable[[], FirstHit]  # of the home at this time


@dataclass(frozen=True, slots=True, eq=False)
class PointTracks:
    """N points in T frames."""

    points: F32  # (N, T, 2) px right and down from the picture's corner; 0 behind the camera
    occluded: Bools  # (N, T) hidden, outside the picture, or behind the camera
    depth_m: F32  # (N, T) as the layer depth_z has it; 0 behind the camera
    query_frame: I32  # (N,) number in the film of the frame in which the point was chosen
    instance: NDArray[np.uint16]  # (N,) of the point's item


def point_tracks(
    frames: Sequence[TrackFrame],
    moving: Bools,
    face_motions: Callable[[float, float], tuple[I64, F64]],
    seed: int,
) -> PointTracks:
    """Tracks of at most MOST_POINTS points, drawn by a seed; equal arguments give equal tracks.

    moving: (F,) of faces. face_motions: of two times, (F,) numbers and (M, 4, 4) matrices that take
    faces from one to the other. Half of the points of a query frame lie on what moves, where it is seen.
    """
    chosen = np.unique(np.linspace(0, len(frames) - 1, _QUERY_FRAMES).round().astype(int))
    rng = np.random.default_rng(seed)
    groups = [
        _chosen_points(frames[q], moving, MOST_POINTS // len(chosen), rng) for q in chosen.tolist()
    ]
    px, depth, hidden = [], [], []
    faces = np.concatenate([face for _points, face, _instance in groups])
    for frame in frames:
        now = np.concatenate(
            [
                _taken(start, face, face_motions(frames[q].time_s, frame.time_s))
                for q, (start, face, _instance) in zip(chosen.tolist(), groups, strict=True)
            ]
        )
        pixels, z = project_points(now, frame.camera)
        inside = np.flatnonzero(inside_picture(pixels, z, frame.camera))
        visible = np.zeros(len(now), bool)
        visible[inside] = reaches(now[inside], faces[inside], frame.camera, frame.first_hit())
        front = (z > 0) & np.isfinite(pixels).all(1)
        px.append(np.where(front[:, None], pixels, 0.0))
        depth.append(np.where(front, z, 0.0))
        hidden.append(~visible)
    n = [len(face) for _points, face, _instance in groups]
    return PointTracks(
        np.stack(px, 1).astype(np.float32),
        np.stack(hidden, 1),
        np.stack(depth, 1).astype(np.float32),
        np.repeat(chosen, n).astype(np.int32),
        np.concatenate([instance for _points, _face, instance in groups]).astype(np.uint16),
    )


def _chosen_points(
    frame: TrackFrame, moving: Bools, n: int, rng: np.random.Generator
) -> tuple[F64, I32, NDArray[np.uint32]]:
    """(K, 3) points behind pixels' centres of a frame, (K,) their faces and instances; K <= n."""
    hit = frame.hit()
    face = hit.face.ravel()
    hit_pixels = np.flatnonzero(face >= 0)
    moves = moving[face[hit_pixels]]
    of_moving = _some(hit_pixels[moves], round(n * _MOVING_SHARE), rng)
    pixels = np.sort(
        np.concatenate([of_moving, _some(hit_pixels[~moves], n - len(of_moving), rng)])
    )
    return points_of_pixels(hit, frame.camera, pixels), face[pixels], hit.item.ravel()[pixels]


def _some(pixels: I64, n: int, rng: np.random.Generator) -> I64:
    return rng.choice(pixels, min(n, len(pixels)), replace=False)


def _taken(points: F64, faces: I32, motions: tuple[I64, F64]) -> F64:
    """(K, 3) points where their faces (K,) take them."""
    number_of_face, matrices = motions
    number, moved = number_of_face[faces], points.copy()
    for k in range(1, len(matrices)):
        is_moved = number == k
        moved[is_moved] = transform_points(matrices[k], points[is_moved])
    return moved
