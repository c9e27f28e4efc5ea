"""How near our pictures' tones and detail are to photographs of rooms. Effects: renders below out/tone, writes out/bench/tone.json.

Views of made homes that nobody looked at while the tones were set, 160x120, recipe fast.

    python -m benchmarks.study.picture_tone             those homes
    python -m benchmarks.study.picture_tone ROOT...     finished views of other output folders
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from scipy import ndimage

import pbrs_farm.cli
from benchmarks.figures import write_report
from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.views import Frame

HOMES: Final = "made:60041..60046"
N_VIEWS: Final = 5  # of each
OUT: Final = Path("out/tone")

# Means over nineteen pictures of RGB-D cameras in ten rooms, shrunk to 160x120.
PHOTOGRAPHS: Final = {"spread": 68.0, "dark": 0.093, "light": 0.047, "chroma": 28.0}

UNITS: Final = {
    "study.spread": "of 255: standard deviation of luma within a picture; photographs 68",
    "study.dark": "share of pixels whose luma is below 20; photographs .093",
    "study.light": "share of pixels whose luma is above 245; photographs .047",
    "study.chroma": "of 255: largest minus least channel, mean; photographs 28",
    "study.tone_gap": "largest relative difference of these four rows to photographs'",
    "study.tone_gap_but_chroma": "the same of the first three",
    "study.detail": "of 255: mean absolute Laplacian of luma; photographs 24",
    "study.detail_ratio": "detail over spread; photographs .35",
    "study.slanted_share": "of pixels whose normal is 15 to 75 degrees off level and upright",
    "study.views": "views measured",
}


def main(places: Sequence[str] = ()) -> None:
    """Render what is not there yet, measure, write the figures."""
    views = [frame for place in places or [_rendered()] for frame in open_views(place)]
    rows = np.array([picture_row(frame.picture("mlt_il_ol")) for frame in views])
    spread, dark, light, chroma, detail = rows.mean(axis=0).tolist()
    slanted = [slanted_share(_world_normals(frame)) for frame in views]
    ours = {"spread": spread, "dark": dark, "light": light, "chroma": chroma}
    gaps = {name: abs(ours[name] / told - 1) for name, told in PHOTOGRAPHS.items()}
    figures = {f"study.{name}": round(value, 4) for name, value in ours.items()}
    figures |= {
        "study.tone_gap": round(max(gaps.values()), 3),
        "study.tone_gap_but_chroma": round(max(v for k, v in gaps.items() if k != "chroma"), 3),
        "study.detail": round(detail, 2),
        "study.detail_ratio": round(detail / spread, 3),
        "study.slanted_share": round(float(np.mean(slanted)), 4),
        "study.views": len(views),
    }
    write_report("tone", figures, UNITS)


def _rendered() -> str:
    words = ["--dress", "1", "--size", "160x120", "--views", str(N_VIEWS), "--modes", "mlt_il_ol"]
    words += ["--set", "cameras.score_width_px=160", "--set", "cameras.score_height_px=120"]
    if pbrs_farm.cli.main(["run", HOMES, *words, "--out", str(OUT)]):
        raise RuntimeError("some views failed")
    return str(OUT)


def picture_row(picture: Srgb8Image) -> F64:
    """(5,) spread, dark, light, chroma and detail of one picture, as UNITS says."""
    rgb = picture.astype(np.float64)
    luma = rgb @ np.array([0.299, 0.587, 0.114])
    detail = np.abs(ndimage.laplace(luma, mode="nearest")).mean()
    chroma = (rgb.max(axis=-1) - rgb.min(axis=-1)).mean()
    return np.array([luma.std(), (luma < 20).mean(), (luma > 245).mean(), chroma, detail])


def slanted_share(normals: F64) -> float:
    """Share of (H, W, 3) world normals that are neither level nor upright by 15 degrees."""
    angle = np.degrees(np.arcsin(np.clip(np.abs(normals[..., 1]), 0, 1)))
    is_hit = np.abs(normals).sum(axis=-1) > 0
    return float(((angle > 15) & (angle < 75) & is_hit).mean())


def _world_normals(frame: Frame) -> F64:
    """(H, W, 3) y up; 0 where nothing is hit."""
    return np.asarray(frame.normal @ frame.world_from_camera_opencv[:3, :3].T)


if __name__ == "__main__":
    main(sys.argv[1:])
