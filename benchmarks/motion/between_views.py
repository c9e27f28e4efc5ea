"""Flow, disparity and occlusion of a stored walk in stereo, against points that check/ follows."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.motion_checks import SEEN, followed, other_view
from pbrs_farm.check.stored_mesh import triangles_from_glb
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F64
from pbrs_farm.core.camera import Camera, Intrinsics
from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.house_bundle import house_from_bundle
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.raycast.caster import Caster
from pbrs_farm.run.house_cache import decoded_textures
from pbrs_farm.run.local import Run, run_local
from pbrs_farm.run.plan import wanted
from pbrs_farm.truth.albedo import albedo_png

HOME: Final = "Studio"
N_PAIRS: Final = int(os.environ.get("PAIRS", "20"))
LAYERS: Final = ("depth_z", "flow_forward", "occlusion_forward", "disparity", "occlusion_stereo")
_SUPER: Final = 3  # rays along each edge of a pixel, of the pictures that are warped
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
        other = other_view(view, relation)
        assert other is not None
        point = followed(view, other, rows, columns, z, rays)
        stored, state = layer(view, name)[rows, columns], layer(view, occlusion)[rows, columns]
        n_wrong, n = n_wrong + int((state != point.state).sum()), n + len(state)
        seen = (state == SEEN) & (point.state == SEEN)
        if relation == "next":
            errors["flow"] = np.abs(stored - point.motion)[seen].max(axis=1)
        else:
            errors["stereo"] = np.abs(stored / 256 - np.abs(point.motion[:, 0]))[seen]
    return errors | {"wrong": n_wrong / n}


def _warped(house: Path, views: list[StoredView]) -> dict[str, float]:
    """PSNR of each second frame, drawn into the first one by its flow, of pictures without noise."""
    home = house_from_bundle(
        (house / "house.glb").read_bytes(), (house / "house.json").read_bytes()
    )
    geometry, textures = geometry_from_house(home), decoded_textures(home)[0]
    caster = Caster(geometry)

    def picture(view: StoredView) -> F64:
        # Diffuse colour under one fixed light: what a surface shows does not depend on the camera.
        height, width = view.size
        k = view.k * np.array([[_SUPER], [_SUPER], [1.0]])
        i = Intrinsics(width * _SUPER, height * _SUPER, k[0, 0], k[1, 1], k[0, 2], k[1, 2])
        pose = np.array(view.table["world_from_camera_opengl"], np.float64)
        hit = caster.hit_record(Camera(i, pose))
        shade = 0.4 + 0.6 * np.abs(hit.geo_normal_world.astype(np.float64) @ _SUN)
        colour = albedo_png(hit, home, geometry, textures) / 255 * shade[..., None]
        return colour.reshape(height, _SUPER, width, _SUPER, 3).mean((1, 3))

    pictures = [picture(view) for view in views[::_APART]]
    whole, within = [], []
    # Take pairs of neighbours among a few frames: one picture takes seconds.
    for k, first in enumerate(views[:-1:_APART]):
        second = picture(views[k * _APART + 1])
        flow, seen = (
            layer(first, "flow_forward").astype(np.float64),
            layer(first, "occlusion_forward") == SEEN,
        )
        rows, columns = np.indices(seen.shape)
        at = np.stack([rows + flow[..., 1], columns + flow[..., 0]])
        drawn = np.stack(
            [
                ndimage.map_coordinates(second[..., c], at, order=1, mode="nearest")
                for c in range(3)
            ],
            -1,
        )
        squared = ((drawn - pictures[k]) ** 2).mean(-1)
        depth = layer(first, "depth_z")
        edge = ndimage.maximum_filter(depth, 3) - ndimage.minimum_filter(depth, 3) > 0.05 * depth
        whole.append(squared[seen].mean())
        within.append(squared[seen & ~edge].mean())
    return {
        "warp_psnr_db": float(-10 * np.log10(np.mean(whole))),
        "warp_psnr_within_db": float(-10 * np.log10(np.mean(within))),
    }
