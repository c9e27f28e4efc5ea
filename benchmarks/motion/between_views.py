"""Flow, disparity and occlusion of a stored walk in stereo, against points that check/ follows."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.followed_points import SEEN, OtherView, follow_points
from pbrs_farm.check.stored_mesh import triangles_from_glb
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F32
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import Geometry, House, geometry_from_house
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.house_bundle import house_from_bundle
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.house_cache import decoded_textures
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.truth.surface_layers import albedo_label

HOME: Final = "Studio"
N_PAIRS: Final = int(os.environ.get("PAIRS", "20"))
LAYERS: Final = ("depth_z", "flow_forward", "occlusion_forward", "disparity", "occlusion_stereo")
_SUPER: Final = 6  # even; rays along each edge of a pixel, of the pictures that are warped
_APART: Final = max(N_PAIRS // 4, 1)  # frames between the pairs that are warped
_SUN: Final = np.array([0.35, 0.8, 0.49])


def figures() -> dict[str, Any]:
    """Run a walk of 20 pairs of frames, and follow every pixel's point through depth and pose."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        fields = {
            "cameras.source": "walk", "cameras.walk_frames": str(N_PAIRS + 1),
            "cameras.walk_fps": "30", "cameras.stereo_m": "0.065",
        }  # fmt: skip
        want = wanted(["opengl_dl"], LAYERS)
        summary = run_local(Run([HOME], str(root), recipe_from_name("fast", fields), want))
        if summary.failures:
            raise RuntimeError(summary.failures[0])
        house = next(root.glob("houses/*"))
        views = [_view(house, f"frame_{k:05d}") for k in range(N_PAIRS + 1)]
        rays = Rays(triangles_from_glb((house / "house.glb").read_bytes()))
        found = [_compared(view, rays) for view in views[:-1]]
        warp = _warped(house, views)
    flow = np.concatenate([f["flow"] for f in found])
    return {
        "flow_error_px": float(flow.max()),
        "flow_error_99_px": float(np.quantile(flow, 0.99)),
        "occlusion_wrong": float(np.mean([f["wrong"] for f in found])),
        "stereo_error_px": float(max(f["stereo"].max() for f in found)),
        **warp,
    }


def _view(house: Path, name: str) -> StoredView:
    folder = house / "views" / name
    return StoredView(folder, json.loads((folder / "view.json").read_text()))


def layer(view: StoredView, name: str) -> NDArray[Any]:
    """A stored layer of a view."""
    return layer_from_bytes(name, (view.folder / LAYER[name].file).read_bytes(), name)


def _compared(view: StoredView, rays: Rays) -> dict[str, Any]:
    """Errors of flow and disparity where the point is seen, and the share of wrong states."""
    depth = layer(view, "depth_z").astype(np.float64)
    rows, columns = np.nonzero(depth > 0)
    z = depth[rows, columns]
    errors: dict[str, Any] = {}
    n_wrong, n = 0, 0
    for relation, name, occlusion in (
        ("next", "flow_forward", "occlusion_forward"),
        ("stereo", "disparity", "occlusion_stereo"),
    ):
        other = OtherView.of(view, relation)
        assert other is not None
        point = follow_points(view, other, (rows, columns), z, rays)
        stored, state = layer(view, name)[rows, columns], layer(view, occlusion)[rows, columns]
        n_wrong, n = n_wrong + int((state != point.state).sum()), n + len(state)
        seen = (state == SEEN) & (point.state == SEEN)
        if relation == "next":
            errors["flow"] = np.abs(stored - point.motion)[seen].max(axis=1)
        else:
            errors["stereo"] = np.abs(stored / 256 - np.abs(point.motion[:, 0]))[seen]
    return errors | {"wrong": n_wrong / n}


def _warped(house: Path, views: list[StoredView]) -> dict[str, float]:
    """PSNR of each second frame, drawn into the first one by its flow, of pictures without noise.

    Pictures are those of the light's own filter, the tent; beside it a box over the pixel, and
    a cubic instead of a linear look-up. Each leaves out the pixels that occlusion_forward does.
    """
    home = house_from_bundle(
        (house / "house.glb").read_bytes(), (house / "house.json").read_bytes()
    )
    scene = (home, geometry_from_house(home), decoded_textures(home)[0])
    caster = Caster(scene[1])
    squared: dict[str, list[float]] = {}
    # Take pairs of neighbours among a few frames: one picture takes seconds.
    for first, second in zip(views[:-1:_APART], views[1::_APART], strict=False):
        flow = layer(first, "flow_forward").astype(np.float64)
        seen = layer(first, "occlusion_forward") == SEEN
        depth = layer(first, "depth_z")
        edge = ndimage.maximum_filter(depth, 3) - ndimage.minimum_filter(depth, 3) > 0.05 * depth
        rows, columns = np.indices(seen.shape)
        at = np.stack([rows + flow[..., 1], columns + flow[..., 0]])
        rays = [_rays_picture(view, caster, scene) for view in (first, second)]
        for name, weigh, order in (("", _tent, 1), ("_cubic", _tent, 3), ("_box", _box, 1)):
            here, there = (weigh(picture) for picture in rays)
            drawn = [
                ndimage.map_coordinates(there[..., c], at, order=order, mode="nearest")
                for c in range(3)
            ]
            error = ((np.stack(drawn, -1) - here) ** 2).mean(-1)
            squared.setdefault(f"warp_psnr{name}_db", []).append(error[seen].mean())
            if not name:
                squared.setdefault("warp_psnr_within_db", []).append(error[seen & ~edge].mean())
    return {name: float(-10 * np.log10(np.mean(errors))) for name, errors in squared.items()}


def _rays_picture(
    view: StoredView, caster: Caster, scene: tuple[House, Geometry, Mapping[str, Any]]
) -> F32:
    """(H * _SUPER, W * _SUPER, 3) colour under one fixed light: the same from every camera."""
    height, width = view.size[0] * _SUPER, view.size[1] * _SUPER
    fx, fy, cx, cy = view.k[[0, 1, 0, 1], [0, 1, 2, 2]] * _SUPER
    pose = np.array(view.table["world_from_camera_opengl"], np.float64)
    picture = np.empty((height, width, 3), np.float32)
    # Go by bands of rows, so that the hit records of 11 million rays never lie together.
    band = height // _SUPER
    for top in range(0, height, band):
        hit = caster.hit_record(Camera(Intrinsics(width, band, fx, fy, cx, cy - top), pose))
        shade = 0.4 + 0.6 * np.abs(hit.geo_normal_world.astype(np.float64) @ _SUN)
        picture[top : top + band] = albedo_label(hit, *scene) / 255 * shade[..., None]
    return picture


def _box(rays: F32) -> F32:
    """(H, W, 3) means over pixels of a picture of rays."""
    height, width, _ = rays.shape
    return np.asarray(
        rays.reshape(height // _SUPER, _SUPER, width // _SUPER, _SUPER, 3).mean((1, 3))
    )


def _tent(rays: F32) -> F32:
    """(H, W, 3) the same by the tent filter, two pixels wide, as light.filter has it."""
    # An even number of rays lies about a pixel's middle; one of no weight makes it odd.
    weights = 1 - np.abs((np.arange(2 * _SUPER) + 0.5) / _SUPER - 1)
    odd = np.append(weights / weights.sum(), 0)
    for axis in (0, 1):
        rays = ndimage.correlate1d(rays, odd, axis, mode="nearest")
    return np.asarray(rays[_SUPER // 2 :: _SUPER, _SUPER // 2 :: _SUPER])
