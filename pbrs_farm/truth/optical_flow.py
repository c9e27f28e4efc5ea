"""Correspondences of surfaces between views: flow, disparity, and occlusion.

No effects: the given function casts rays. In a home with motions, a surface point moves rigidly with its face between
the times of the views.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, I32, I64, Bools, FirstHit, HitRecord
from pbrs_farm.core.camera import Camera, View
from pbrs_farm.core.frames import opencv_world_from_camera, transform_points

SEEN: Final = 0
OUTSIDE: Final = 128  # outside the other picture, or behind the other camera
HIDDEN: Final = 255  # behind another surface
KITTI_FLOW_STEP: Final = 64  # steps a pixel, 2**15 is no motion
KITTI_DISPARITY_STEP: Final = 256
_MOST_PX: Final = 2.0**15  # of flow: 16-bit floats end at twice that
_SAME_ROWS: Final = 1e-9  # of two cameras' rotation, and metres
_NEAREST_M: Final = 1e-3  # to the other camera's plane
_SLACK: Final = 1e-5  # of the distance, and metres: ten times what 32-bit rays are off
Relation = Literal["next", "previous", "stereo"]


@dataclass(frozen=True, slots=True, eq=False)
class Correspondence:
    """Position of each pixel's surface point in another picture."""

    flow: F64  # (H, W, 2) pixels to the right and down; 0 where nothing is seen or it is behind
    state: NDArray[np.uint8]  # (H, W) SEEN, OUTSIDE or HIDDEN; OUTSIDE where nothing is seen
    in_front: Bools  # (H, W) the flow is defined


@dataclass(frozen=True, slots=True, eq=False)
class OtherTime:
    """The home at the time of another view, with the motions until then."""

    first_hit: FirstHit  # of the home at that time
    number_of_face: I64  # (F,) index of the face's matrix; 0 = static
    matrices: F64  # (M, 4, 4) rigid, world to world; the first is the identity


def correspondence(
    hit: HitRecord,
    camera: Camera,
    other: Camera,
    first_hit: FirstHit,
    then: OtherTime | None = None,
) -> Correspondence:
    """The surface points of a camera's hit record in the other picture; then: the home then, if moved."""
    shape = hit.face.shape
    pixels = np.flatnonzero(hit.face.ravel() >= 0)
    points = points_of_pixels(hit, camera, pixels)
    if then is not None:
        first_hit = then.first_hit
        _move_points(points, hit.face.ravel()[pixels], then)
    pixels_there, z = project_points(points, other)
    # Subtract the pixel's own centre.
    rows, columns = np.divmod(pixels, shape[1])
    front = z > _NEAREST_M
    flow = np.zeros((2, hit.face.size))
    for axis, centre in enumerate((columns + 0.5, rows + 0.5)):
        flow[axis, pixels] = np.where(front, pixels_there[:, axis] - centre, 0.0)
    # Points inside the other picture are visible if no ray ends before them.
    inside = np.flatnonzero(inside_picture(pixels_there, z, other))
    visible = reaches(points.T[:, inside].T, hit.face.ravel()[pixels[inside]], other, first_hit)
    states = np.full(shape, OUTSIDE, np.uint8)
    states.ravel()[pixels[inside]] = np.where(visible, SEEN, HIDDEN)

    in_front = np.zeros(shape, bool)
    in_front.ravel()[pixels] = front
    return Correspondence(np.moveaxis(flow.reshape(2, *shape), 0, -1), states, in_front)


def points_of_pixels(hit: HitRecord, camera: Camera, pixels: I64) -> F64:
    """(N, 3) surface points behind pixels, in double precision from the ray and the stored depth."""
    origin, directions = camera.exact_rays()
    depth = hit.depth_z.ravel()[pixels].astype(np.float64)
    rays = directions.reshape(-1, 3).take(pixels, axis=0)
    points = np.empty((3, len(pixels))).T  # each axis is contiguous: half of the time
    for axis in range(3):
        points[:, axis] = origin[axis] + depth * rays[:, axis]
    return points


def _move_points(points: F64, faces: I32, then: OtherTime) -> None:
    """Move points (N, 3) in place with the faces (N,) that they lie on."""
    number = then.number_of_face[faces]
    for k in range(1, len(then.matrices)):
        moved = np.flatnonzero(number == k)
        points[moved] = transform_points(then.matrices[k], points[moved])


def scene_flow_label(hit: HitRecord, camera: Camera, then: OtherTime | None) -> F32:
    """(H, W, 3) metres, world axes: motion of each pixel's surface point until the other time, or 0."""
    moved = np.zeros((hit.face.size, 3))
    if then is not None:
        faces = hit.face.ravel()
        pixels = np.flatnonzero((faces >= 0) & (then.number_of_face[faces] > 0))
        points = points_of_pixels(hit, camera, pixels)
        begin = points.copy()
        _move_points(points, faces[pixels], then)
        moved[pixels] = points - begin
    return moved.reshape(*hit.face.shape, 3).astype(np.float32)


def project_points(points: F64, camera: Camera) -> tuple[F64, F64]:
    """(N, 2) px, x right, y down, of world points, (N,) depth_z; NaN and 0 where a lens does not see them."""
    if not camera.intrinsics.lens.is_pinhole:
        px = camera.pixels_of(points)
        return px, np.where(np.isfinite(px).all(1), camera.depths_of(points), 0.0)
    # Axis by axis: a third of the time of one product with a 3 x 3 matrix.
    x, y, z = points.T
    axes = camera.world_from_camera[:3, :3].T
    right, up, back = (x * a[0] + y * a[1] + z * a[2] - camera.eye @ a for a in axes)
    i = camera.intrinsics
    px = np.empty((2, len(points))).T
    with np.errstate(divide="ignore", invalid="ignore"):
        px[:, 0], px[:, 1] = i.cx - i.fx * right / back, i.cy + i.fy * up / back
    return px, np.asarray(-back)


def inside_picture(px: F64, z: F64, camera: Camera) -> Bools:
    """(N,) true if pixels (N, 2) at depths z (N,) are in front of a camera and in its picture; see `reaches`."""
    i = camera.intrinsics
    with np.errstate(invalid="ignore"):
        inside = (px[:, 0] >= 0) & (px[:, 0] < i.width_px)
        inside &= (px[:, 1] >= 0) & (px[:, 1] < i.height_px)
    return np.asarray((z > _NEAREST_M) & inside)


def reaches(points: F64, faces: I32, camera: Camera, first_hit: FirstHit) -> Bools:
    """(N,) true if a ray from the camera reaches each point (N, 3), to rounding, or hits its own face (N,)."""
    if not len(points):
        return np.zeros(0, bool)
    to = points - camera.eye
    distance = np.sqrt(to[:, 0] ** 2 + to[:, 1] ** 2 + to[:, 2] ** 2)
    t, face = first_hit(np.broadcast_to(camera.eye, to.shape), to)
    slack = _SLACK + _SLACK / np.maximum(distance, _SLACK)
    return np.asarray((t >= 1 - slack) | (face == faces))


def flow_label(matches: Correspondence) -> F32:
    """(H, W, 2) float32 for a 16-bit EXR: pixels right and down up to 32,768, 0 where undefined."""
    return np.clip(matches.flow, -_MOST_PX, _MOST_PX).astype(np.float32)


def flow_kitti(matches: Correspondence) -> NDArray[np.uint16]:
    """(H, W, 3) uint16 of KITTI's flow: 64 x + 2**15, 64 y + 2**15, 1 if seen; 0 also beyond 512 px."""
    steps = np.rint(matches.flow * KITTI_FLOW_STEP) + 2**15
    valid = (matches.state == SEEN) & ((steps >= 0) & (steps <= 65535)).all(-1)
    steps = np.where(valid[..., None], np.clip(steps, 0, 65535), 0)
    return np.concatenate([steps, valid[..., None]], axis=-1).astype(np.uint16)


def disparity_label(matches: Correspondence) -> NDArray[np.uint16]:
    """(H, W) uint16 of KITTI's disparity: 256 times the shift in pixels, seen or hidden; 0 = nothing."""
    shift = np.abs(matches.flow[..., 0])
    steps = np.clip(np.rint(shift * KITTI_DISPARITY_STEP), 1, 65535)
    return np.where(matches.in_front, steps, 0).astype(np.uint16)


def partners_of(view: View, views: Mapping[str, View]) -> dict[Relation, View]:
    """Partners of a view in its house: "stereo", "next" and "previous", if it has a rig or a sequence."""
    partners: dict[Relation, View] = {}
    stereo = _rectified_partner(view, views)
    if stereo is not None:
        partners["stereo"] = stereo
    if view.frame is None:
        return partners
    neighbours: tuple[tuple[Relation, int], ...] = (("next", 1), ("previous", -1))
    for relation, step in neighbours:
        neighbour = views.get(view.shot.partner(step).id)
        if neighbour is not None:
            partners[relation] = neighbour
    return partners


def _rectified_partner(view: View, views: Mapping[str, View]) -> View | None:
    """The nearest (first) view of the instant with the same lens, axes and rows; None without one."""
    if view.rig is None:
        return None
    place, distances = view.rig, dict[str, float]()
    camera_from_rig = np.linalg.inv(place.rig_from_camera)
    for name, candidate in views.items():
        if name == view.id or candidate.rig is None or candidate.rig.instant != place.instant:
            continue
        between = camera_from_rig @ candidate.rig.rig_from_camera
        aside = abs(float(between[0, 3]))
        between[0, 3] = 0.0
        same_rows = np.abs(between - np.eye(4)).max() <= _SAME_ROWS and aside > _SAME_ROWS
        if same_rows and candidate.camera.intrinsics == view.camera.intrinsics:
            distances[name] = aside
    return views[min(distances, key=distances.__getitem__)] if distances else None


def partner_table(
    partners: Mapping[Relation, View], cameras: Mapping[Relation, Camera]
) -> dict[str, Any]:
    """Relation -> id, K, pose (OpenCV's axes, metres) and time of the partner, for view.json."""
    return {
        relation: {
            "view": view.id,
            "time_s": view.time_s,
            "K": cameras[relation].intrinsics.k.tolist(),
            "world_from_camera_opencv": opencv_world_from_camera(
                cameras[relation].world_from_camera
            ).tolist(),
        }
        for relation, view in sorted(partners.items())
    }
