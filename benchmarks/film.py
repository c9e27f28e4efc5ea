"""Films: noise between frames, and errors of flow, occlusion and disparity: `make bench NAME=film` -> out/bench/film.json.

Noise is the PSNR of the next frame's light, warped into this one by its flow, away from occluded pixels and depth edges.
OpenGL has no noise: its PSNR is the error of the warp. Flow, occlusion and disparity are compared with points that
check/ follows by Embree's rays. Effects: renders into a temporary folder.
"""

from __future__ import annotations

import itertools
import json
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy import ndimage

import pbrs_farm
import pbrs_farm.cli
from benchmarks.figures import write_report
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.followed_points import SEEN, follow_points, partner_of
from pbrs_farm.check.stored_mesh import triangles_from_glb
from pbrs_farm.check.stored_view import StoredView
from pbrs_farm.core.arrays import F32, Bools
from pbrs_farm.core.layers import LAYER
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.layer_file import layer_from_bytes
from pbrs_farm.formats.radiance_exr import radiance_from_exr
from pbrs_farm.run.relight import linear_aovs
from pbrs_farm.transport.develop.mode_pictures import denoise_aovs
from pbrs_farm.transport.develop.tone_mapping import tone
from pbrs_farm.views.views import Frame

HOME: Final = "Studio"
N_FRAMES: Final = 10  # with light, at 12 Hz
N_PAIRS: Final = 4  # of frames and of eyes, at 30 Hz and 640x480
_EDGE: Final = 0.05  # relative depth difference of neighbours that is a depth edge
UNITS: Final = {
    "film.noise_db": f"dB, denoised light of {N_FRAMES} frames at 12 Hz and 320x240 by `fast`, the pair's first exposure for both",
    "film.picture_db": "dB, their stored pictures, each with its own exposure",
    "film.opengl_db": "dB, their OpenGL-IL pictures",
    "film.light_s": "s of light and picture of a frame after the first, median",
    "film.flow_error_px": f"px, largest error of flow, {N_PAIRS} pairs of frames at 640x480",
    "film.occlusion_wrong": "share of pixels whose occlusion differs from Embree's",
    "film.disparity_error_px": "px, largest error of disparity",
}


def main() -> None:
    """Measure and write out/bench/film.json."""
    with tempfile.TemporaryDirectory() as folder:
        figures = noise_figures(Path(folder, "light")) | label_figures(Path(folder, "labels"))
    write_report("film", figures, UNITS)


def noise_figures(root: Path) -> dict[str, float]:
    """PSNR along the flow of light, pictures and OpenGL, and seconds of a frame's light."""
    _run(
        root, "--dress", "1", "--recipe", "fast", "--size", "320x240", "--frames", str(N_FRAMES), "--fps", "12",
        "--modes", "mlt_il_ol", "opengl_il", "--layers", "depth_z", "flow_forward", "occlusion_forward",
    )  # fmt: skip
    frames = sorted(pbrs_farm.open(root), key=lambda frame: frame.id)
    squared: dict[str, list[float]] = {"noise": [], "picture": [], "opengl": []}
    pairs: dict[str, list[F32]]
    for first, second in itertools.pairwise(frames):
        exposure, gains = _metering(root, first)
        pairs = {
            "noise": [_exposed(root, frame, exposure, gains) for frame in (first, second)],
            "picture": [f.picture("mlt_il_ol").astype(np.float32) for f in (first, second)],
            "opengl": [f.picture("opengl_il").astype(np.float32) for f in (first, second)],
        }
        for name, (here, there) in pairs.items():
            squared[name].append(_squared_error(first, here, there))
        print(first.id, {n: round(_psnr(e[-1:]), 1) for n, e in squared.items()}, flush=True)
    seconds = [sum(_marker(root, step, frame)["seconds"] for step in ("light", "develop")) for frame in frames]  # fmt: skip
    return {f"film.{name}_db": round(_psnr(errors), 2) for name, errors in squared.items()} | {
        "film.light_s": round(float(np.median(seconds[1:])), 2)
    }


def _run(root: Path, *words: str) -> None:
    if pbrs_farm.cli.main(["run", HOME, "--cameras", "walk", *words, "--out", str(root)]):
        raise RuntimeError(f"{root}: the film was not rendered")


def _marker(root: Path, step: str, frame: Frame) -> Any:
    view = frame.id.rpartition("/")[2]
    return json.loads(next(root.glob(f"houses/*/done/{step}.{view}.json")).read_text())


def _metering(root: Path, frame: Frame) -> tuple[float, Any]:
    """Exposure and white balance of a frame's stored picture."""
    facts = _marker(root, "develop", frame)["facts"]["mlt_il_ol"]
    return facts["exposure"], facts["gains"]


def _exposed(root: Path, frame: Frame, exposure: float, gains: Any) -> F32:
    """A frame's denoised light as an sRGB picture, 0 to 255."""
    view = frame.id.rpartition("/")[2]
    file = next(root.glob(f"houses/*/views/{view}/{LAYER['radiance'].file}"))
    light = denoise_aovs(linear_aovs(radiance_from_exr(file.read_bytes(), str(file))))
    picture = (light.outdoor + light.indoor) * np.float32(gains)
    return np.asarray(tone(picture, recipe_from_name("fast").tone, exposure=exposure), np.float32)


def _squared_error(first: Frame, here: F32, there: F32) -> float:
    """Mean squared difference of two pictures (0 to 255) along the flow, of a range of 1."""
    flow = first.layer("flow_forward").astype(np.float64)
    rows, columns = np.indices(flow.shape[:2])
    positions = np.stack([rows + flow[..., 1], columns + flow[..., 0]])
    warped = np.stack(
        [ndimage.map_coordinates(there[..., c], positions, order=3, mode="nearest") for c in range(3)], -1
    )  # fmt: skip
    return float((((warped - here[..., :3]) / 255) ** 2).mean(-1)[_valid(first)].mean())


def _valid(frame: Frame) -> Bools:
    """(H, W) pixels farther than two pixels from an occluded pixel and from a depth edge: a cubic look-up reaches so far."""
    depth = frame.layer("depth_z")
    step = ndimage.maximum_filter(depth, 3) - ndimage.minimum_filter(depth, 3)
    excluded = (frame.layer("occlusion_forward") != SEEN) | (step > _EDGE * depth)
    return ~ndimage.binary_dilation(excluded, np.ones((5, 5)))


def _psnr(squared: Sequence[float]) -> float:
    return float(-10 * np.log10(np.mean(squared)))


def label_figures(root: Path) -> dict[str, float]:
    """Errors of flow, occlusion and disparity over all pixels of a stereo walk."""
    _run(
        root, "--stereo", "0.065", "--recipe", "fast", "--size", "640x480", "--frames", str(N_PAIRS + 1),
        "--fps", "30", "--modes", "opengl_dl",
        "--layers", "depth_z", "flow_forward", "occlusion_forward", "disparity", "occlusion_stereo",
    )  # fmt: skip
    (house,) = root.glob("houses/*")
    rays = Rays(triangles_from_glb((house / "house.glb").read_bytes()))
    flow, disparity, wrong = 0.0, 0.0, []
    for k in range(N_PAIRS):
        folder = house / "views" / f"frame_{k:05d}"
        view = StoredView(folder, json.loads((folder / "view.json").read_text()))
        error, share = _followed(view, rays, "next", "flow_forward", "occlusion_forward")
        flow, wrong = max(flow, error), [*wrong, share]
        error, share = _followed(view, rays, "stereo", "disparity", "occlusion_stereo")
        disparity, wrong = max(disparity, error), [*wrong, share]
    return {
        "film.flow_error_px": float(f"{flow:.2g}"),
        "film.occlusion_wrong": float(f"{np.mean(wrong):.2g}"),
        "film.disparity_error_px": float(f"{disparity:.2g}"),
    }


def _followed(
    view: StoredView, rays: Rays, relation: str, motion: str, occlusion: str
) -> tuple[float, float]:
    """(largest error of a view's motion layer in px, share of pixels with another occlusion)."""
    partner = partner_of(view, relation)
    assert partner is not None
    depth = _layer(view, "depth_z").astype(np.float64)
    rows, columns = np.nonzero(depth > 0)
    point = follow_points(view, partner, (rows, columns), depth[rows, columns], rays)
    state = _layer(view, occlusion)[rows, columns]
    stored = _layer(view, motion)[rows, columns]
    visible = (state == SEEN) & (point.state == SEEN)
    if motion == "disparity":
        error = np.abs(stored / 256 - np.abs(point.motion[:, 0]))[visible]
    else:
        error = np.abs(stored - point.motion)[visible]
    return float(error.max()), float((state != point.state).mean())


def _layer(view: StoredView, name: str) -> Any:
    return layer_from_bytes(name, (view.folder / LAYER[name].file).read_bytes(), name)


if __name__ == "__main__":
    main()
