"""Rays of a camera on the device: a pin-hole's by formula, any other's from a table; kernels, no effects.

The table has a row for each pixel, so that no kernel depends on a lens: one kernel serves all of
them, with or without depth of field, motion blur and rolling shutter, and another serves the plain pin-hole.
"""

from __future__ import annotations

import functools
from typing import Any, Final, NamedTuple

import drjit as dr
import mitsuba as mi
import numpy as np

from pbrs_farm.core.arrays import F32, Bools
from pbrs_farm.core.camera import Camera, CameraBlur, Intrinsics
from pbrs_farm.transport.kernels.sampler import Sampler, device_array, opaque3
from pbrs_farm.transport.scene_tables.material_rows import GLASS, MIRROR

_LENS_DIM: Final = 1 << 24  # random dimensions far beyond those of any path's vertices
_TIME_DIM: Final = _LENS_DIM + 2
_SHIFT_PX: Final = 0.25  # from a pixel's centre to where its direction's slope is taken
_ROW: Final = 3  # packets of four floats of a pixel: direction, its change to the right, and down


class DeviceCamera(NamedTuple):
    """A pin-hole as opaque device values: another camera is no new kernel."""

    eye: Any  # Point3f
    d0: Any  # Vector3f, direction at pixel coordinates (0, 0)
    du: Any  # what a pixel to the right adds
    dv: Any  # what a pixel down adds


class LensCamera(NamedTuple):
    """A camera with a lens, an aperture and a shutter, as opaque device values."""

    eye: Any  # Point3f, at mid-shutter
    right: Any  # Vector3f, the camera's axes in the world
    up: Any
    back: Any
    table: Any  # (pixels * 12,) as ray_table
    width: Any  # UInt32, px
    aperture: Any  # radius of the pupil, m; 0 = a point
    focus: Any  # depth of focus, m
    velocity: Any  # Vector3f, m that the eye moves while the picture is taken
    turn_axis: Any  # Vector3f, unit
    turn: Any  # rad about it while the picture is taken
    exposure: Any  # share of that time for which a row is open
    rolling: Any  # share of it from the first row's light to the last one's
    row: Any  # share of it from a row's light to the next one's
    middle: Any  # offset from mid-shutter to the centre of the current part, as a share of the shutter time


def device_camera(camera: Camera) -> DeviceCamera | LensCamera:
    """Device values; of a sharp pin-hole the direction at (u, v) is d0 + u du + v dv.

    A camera with a lens that bends or with blur gives a LensCamera, which costs a kernel of its
    own. Values are opaque: another pose runs the same kernel.
    """
    i, r = camera.intrinsics, camera.world_from_camera[:3, :3]
    if not i.lens.is_pinhole or camera.blur is not None:
        return _lens_camera(camera)
    d0 = r @ np.array([-i.cx / i.fx, i.cy / i.fy, -1.0])
    return DeviceCamera(
        opaque3(mi.Point3f, camera.eye),
        opaque3(mi.Vector3f, d0),
        opaque3(mi.Vector3f, r[:, 0] / i.fx),
        opaque3(mi.Vector3f, -r[:, 1] / i.fy),
    )


def _lens_camera(camera: Camera) -> LensCamera:
    r, blur = camera.world_from_camera[:3, :3], camera.blur or CameraBlur()
    turn = float(np.linalg.norm(blur.turn_rad))
    axis = np.asarray(blur.turn_rad) / turn if turn > 0 else np.array([0.0, 1.0, 0.0])
    return LensCamera(
        opaque3(mi.Point3f, camera.eye),
        opaque3(mi.Vector3f, r[:, 0]),
        opaque3(mi.Vector3f, r[:, 1]),
        opaque3(mi.Vector3f, r[:, 2]),
        device_array(mi.Float, ray_table(camera.intrinsics).ravel()),
        dr.opaque(mi.UInt32, camera.intrinsics.width_px),
        dr.opaque(mi.Float, blur.aperture_radius_m),
        dr.opaque(mi.Float, blur.focus_m),
        opaque3(mi.Vector3f, blur.velocity_m),
        opaque3(mi.Vector3f, axis),
        dr.opaque(mi.Float, turn),
        dr.opaque(mi.Float, blur.open_share),
        dr.opaque(mi.Float, blur.rolling_share),
        dr.opaque(mi.Float, blur.rolling_share / camera.intrinsics.height_px),
        dr.opaque(mi.Float, blur.middle_share),
    )


@functools.lru_cache(maxsize=3)
def ray_table(i: Intrinsics) -> F32:
    """(H * W, 12) float32 by pixel: direction at its centre, its change per pixel right, and down.

    OpenGL's camera axes, four numbers each, the last 0; a pixel without a ray looks along the axis.
    A pixel's own slope serves its whole filter: faces of a cube map do not mix at their edges.
    """
    x, y = np.meshgrid(np.arange(i.width_px) + 0.5, np.arange(i.height_px) + 0.5)
    centre = np.stack([x.ravel(), y.ravel()], axis=1)
    flip = [1.0, -1.0, -1.0]
    table = np.zeros((len(centre), _ROW, 4), np.float32)
    middle = i.directions(centre)
    has_ray = np.asarray(middle.any(1))
    table[:, 0, :3] = np.where(has_ray[:, None], middle, [0.0, 0.0, 1.0]) * flip
    for k, shift in ((1, [_SHIFT_PX, 0.0]), (2, [0.0, _SHIFT_PX])):
        after, before = i.directions(centre + shift), i.directions(centre - shift)
        whole = np.asarray(has_ray & after.any(1) & before.any(1))
        table[:, k, :3] = np.where(whole[:, None], after - before, 0.0) / (2 * _SHIFT_PX) * flip
    table.setflags(write=False)
    return table.reshape(len(centre), _ROW * 4)


def camera_ray(
    camera: DeviceCamera | LensCamera, corner: Any, offset: Any, sampler: Sampler | None
) -> tuple[Any, Any]:
    """(origin, unit direction) at a pixel's corner plus an offset, px; sampler draws pupil and time, None: the middle."""
    if isinstance(camera, DeviceCamera):
        x, y = corner.x + offset.x, corner.y + offset.y
        return mi.Point3f(camera.eye), dr.normalize(camera.d0 + x * camera.du + y * camera.dv)
    # Follow the pixel's direction to the place on the film.
    row = (mi.UInt32(corner.y) * camera.width + mi.UInt32(corner.x)) * _ROW
    middle, right, down = (dr.gather(mi.Vector4f, camera.table, row + k) for k in range(_ROW))
    along = middle + (offset.x - 0.5) * right + (offset.y - 0.5) * down
    local, start = mi.Vector3f(along.x, along.y, along.z), mi.Vector3f(0)
    # Rows are lit one after another, the middle one at mid-shutter.
    time = (corner.y + offset.y) * camera.row - 0.5 * camera.rolling + camera.middle
    if sampler is not None:
        # Start anywhere in the pupil and aim at the point in focus.
        pupil = mi.warp.square_to_uniform_disk_concentric(sampler.get_2d(mi.UInt32(_LENS_DIM)))
        start = mi.Vector3f(pupil.x * camera.aperture, pupil.y * camera.aperture, 0)
        local = local * camera.focus - start
        time += (sampler.get_1d(mi.UInt32(_TIME_DIM)) - 0.5) * camera.exposure
    # Stand where the camera is at that time.
    moved, angle = camera.velocity * time, camera.turn * time
    d = _turn_camera_vector(camera, local, angle)
    origin = mi.Point3f(camera.eye + moved + _turn_camera_vector(camera, start, angle))
    return origin, dr.normalize(d)


def _turn_camera_vector(camera: LensCamera, v: Any, angle: Any) -> Any:
    """A vector of the camera's axes in the world, when the camera has turned by an angle."""
    world = camera.right * v.x + camera.up * v.y + camera.back * v.z
    axis, c, s = camera.turn_axis, dr.cos(angle), dr.sin(angle)
    # Rodrigues' formula.
    return world * c + dr.cross(axis, world) * s + axis * (dr.dot(axis, world) * (1 - c))


def first_points(scene: Any, camera: Camera) -> F32:
    """(H * W, 3) surface point at each pixel's centre, row by row; infinite without a hit."""
    si, _origin, _d = _first_hits(scene, camera)
    p = dr.select(si.valid, si.p, dr.inf)
    dr.eval(p)
    return np.stack([axis.numpy() for axis in p], axis=-1)


def scatters_first(scene: Any, camera: Camera) -> Bools:
    """(H, W) False at pixels whose centre shows a mirror, glass or a pane of a window."""
    si, origin, d = _first_hits(scene, camera)
    if scene.panes is not None:
        si, _is_pane, _is_inner = scene.panes.before(si, origin, d, mi.Bool(True))
    is_clear = si.valid & ~si.is_cutout & ((si.bsdf.kind == GLASS) | (si.bsdf.kind == MIRROR))
    dr.eval(is_clear)
    i = camera.intrinsics
    return np.asarray(~is_clear.numpy().astype(bool).reshape(i.height_px, i.width_px))


def _first_hits(scene: Any, camera: Camera) -> tuple[Any, Any, Any]:
    """The hits of the rays through the pixels' centres, and the rays."""
    width = dr.opaque(mi.UInt32, camera.intrinsics.width_px)
    pixel = dr.arange(mi.UInt32, camera.intrinsics.width_px * camera.intrinsics.height_px)
    corner = mi.Point2f(mi.Float(pixel % width), mi.Float(pixel // width))
    origin, d = camera_ray(device_camera(camera), corner, mi.Point2f(0.5), None)
    return scene.intersect(origin, d, mi.Bool(True)), origin, d
