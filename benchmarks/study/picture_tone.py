"""Tones of a set's pictures beside those of photographs of rooms: `make bench NAME=tone` -> out/bench/tone.json.

Views of generated homes that nobody saw while the tone was set (made:60141..60146 served for that), 320x240, as the set
indoor-1k renders them. Their stored light is developed by the cameras of several seeds, so that the mean depends less on
the draw. The photographs, 34 of rooms, are public examples of other projects at these commits: NYUv2's of
ialhashim/DenseDepth (2e15107, 12, without their white border) and of yindaz/surface_normal (257ee9d: 0001 0008 0013 0014, likewise), SUN
RGB-D's of chengzhag/Implicit3DUnderstanding (517c0ff, 8), offices of baegwangbin/DSINE (ef0c2af, 8), 01 and 02 of
microsoft/MoGe (0744441).
Effects: renders below out/tone; writes a sheet of the six worst views, out/tone/worst.png, and one of all, out/tone/views.png,
each beside its picture by the neutral camera.

    python -m benchmarks.study.picture_tone             those homes
    python -m benchmarks.study.picture_tone ROOT...     finished views of other output folders
    python -m benchmarks.study.picture_tone --photographs FOLDER     the same figures of pictures in a folder
"""

from __future__ import annotations

import sys
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from PIL import Image

import pbrs_farm.cli
from benchmarks.figures import write_report
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import F64, Mask, Srgb8Image
from pbrs_farm.core.recipe import ToneFields, recipe_from_json
from pbrs_farm.formats.radiance_exr import FILE as RADIANCE_EXR
from pbrs_farm.formats.radiance_exr import radiance_from_exr
from pbrs_farm.run.relight import linear_aovs
from pbrs_farm.sets.data_set import SHIPPED
from pbrs_farm.transport.develop.mode_pictures import LinearAovs, denoise_aovs, develop
from pbrs_farm.transport.develop.tone_mapping import flatten_light
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.views import Frame

HOMES: Final = "made:60041..60046"
N_VIEWS: Final = 4  # of each
N_DRAWS: Final = 6  # cameras of a view
SET: Final = "indoor-1k.toml"
OUT: Final = Path("out/tone")
N_WORST: Final = 6
DIM: Final = 70  # of 255: mean luma below which a picture is dim
# Pixels from a step: beside it up to the first, undisturbed between the others.
_HALO_PX: Final = (2, 6, 12)

PHOTOGRAPHS: Final = {"tone.mean_luma": 113.8, "tone.below_20": 0.0699}
UNITS: Final = {
    "tone.mean_luma": "of 255; photographs 113.8",
    "tone.mean_luma_gap": "difference to photographs",
    "tone.below_20": "share of pixels whose luma is below 20; photographs .070",
    "tone.below_20_gap": "difference to photographs",
    "tone.above_245": "share of pixels above 245; photographs .028",
    "tone.dim": f"share of pictures with a mean luma below {DIM}; photographs 0",
    "tone.luma_spread": "of 255: standard deviation of mean luma between pictures; photographs 18.5",
    "tone.sd": "of 255: standard deviation of luma within a picture; photographs 63",
    "tone.black": "share of pixels whose luma is below 3; photographs .004",
    "tone.blown": "share of pixels above 245, windows and what is behind them left out",
    "tone.blown_worst": "the same of the worst picture",
    "tone.p1": "of 255: luma that 1 % of the pixels are below; photographs 8.8",
    "tone.p95": "of 255: luma that 5 % of the pixels are above; photographs 216",
    "tone.chroma": "of 255: largest minus least channel, mean; photographs 31",
    "tone.neutral_luma": "of 255: mean luma of the same light by the neutral camera",
    "tone.halo": "largest share of a step of light that local contrast of .4 adds beside it",
    "tone.views": "views measured",
}


def main(words: Sequence[str] = ()) -> None:
    """Render missing views, measure, write the figures and the sheets."""
    if words and words[0] == "--photographs":
        files = sorted(path for folder in words[1:] for path in Path(folder).iterdir())
        photographs = [np.asarray(Image.open(file).convert("RGB")) for file in files]
        measured = np.array([picture_row(p, np.zeros(p.shape[:2], bool)) for p in photographs])
        print(*(f"{name} {value}" for name, value in figures_of(measured).items()), sep="\n")
        return
    rows, views, neutral = list[F64](), list[Frame](), list[Srgb8Image]()
    for place in words or [_rendered()]:
        recipe = recipe_from_json((Path(place) / "recipe.json").read_bytes(), place)
        for frame in open_views(place):
            ref, windows = frame.ref, window_mask(frame)
            file = Path(place) / keys.view_key(ref.house, ref.view, RADIANCE_EXR)
            light = denoise_aovs(linear_aovs(radiance_from_exr(file.read_bytes(), str(file))))
            for seed in range(N_DRAWS):
                camera = recipe.model_copy(update={"seed": seed}).camera_of(ref.house, ref.view)
                rows.append(picture_row(_developed(light, camera.tone), windows))
            views.append(frame)
            neutral.append(_developed(light, ToneFields()))
    figures = figures_of(np.array(rows))
    figures |= {f"{n}_gap": round(abs(figures[n] - x), 4) for n, x in PHOTOGRAPHS.items()}
    figures |= {
        "tone.neutral_luma": round(float(np.mean([_luma(p).mean() for p in neutral])), 1),
        "tone.halo": round(halo_of_a_step(), 4),
        "tone.views": len(views),
    }
    pictures = [frame.picture("mlt_il_ol") for frame in views]
    seen = np.array([picture_row(p, window_mask(f)) for f, p in zip(views, pictures, strict=True)])
    worst = np.argsort(seen[:, 5] + seen[:, 7])[::-1][:N_WORST]
    write_sheet([pictures[k] for k in worst], OUT / "worst.png")
    pairs = [p for pair in zip(neutral, pictures, strict=True) for p in pair]
    write_sheet(pairs, OUT / "views.png", width=4)
    for k in worst:
        print(f"{views[k].id}: black {seen[k, 5]:.3f}, blown {seen[k, 7]:.3f}")
    write_report("tone", figures, UNITS)


def _developed(light: LinearAovs, tone: ToneFields) -> Srgb8Image:
    return develop(light, tone, denoise=False)["mlt_il_ol"].rgb_srgb8


def _rendered() -> str:
    words = ["--dress", "1", "--size", "320x240", "--views", str(N_VIEWS), "--modes", "mlt_il_ol"]
    words += ["--layers", "glass", "--recipe", "fast"]
    for setting in tomllib.loads((SHIPPED / SET).read_text())["render"]["set"]:
        words += ["--set", setting]
    if pbrs_farm.cli.main(["run", HOMES, *words, "--out", str(OUT / "views")]):
        raise RuntimeError("some views failed")
    return str(OUT / "views")


def window_mask(frame: Frame) -> Mask:
    """(H, W) True for panes, pixels behind them, and pixels without a surface."""
    glass = (
        frame.layer("glass") > 0 if "glass" in frame.layers else np.zeros(frame.depth.shape, bool)
    )
    return np.asarray(glass | (frame.depth == 0))


def picture_row(picture: Srgb8Image, is_window: Mask) -> F64:
    """(9,) mean, sd, p1 and p95 of luma; shares below 20, below 3, above 245, above 245 beside windows; chroma."""
    rgb = picture.astype(np.float64)
    luma = _luma(picture)
    p1, p95 = np.percentile(luma, [1, 95])
    shares = [(luma < 20), (luma < 3), (luma > 245), (luma > 245) & ~is_window]
    chroma = (rgb.max(axis=-1) - rgb.min(axis=-1)).mean()
    return np.array([luma.mean(), luma.std(), p1, p95, *(s.mean() for s in shares), chroma])


def figures_of(rows: F64) -> dict[str, Any]:
    """The figures of UNITS that rows of `picture_row` give."""
    mean, sd, p1, p95, dark, black, white, blown, chroma = rows.mean(axis=0).tolist()
    return {
        "tone.mean_luma": round(mean, 1),
        "tone.below_20": round(dark, 4),
        "tone.above_245": round(white, 4),
        "tone.dim": round(float((rows[:, 0] < DIM).mean()), 3),
        "tone.luma_spread": round(float(rows[:, 0].std()), 1),
        "tone.sd": round(sd, 1),
        "tone.black": round(black, 4),
        "tone.blown": round(blown, 4),
        "tone.blown_worst": round(float(rows[:, 7].max()), 4),
        "tone.p1": round(p1, 2),
        "tone.p95": round(p95, 1),
        "tone.chroma": round(chroma, 1),
    }


def _luma(picture: Srgb8Image) -> F64:
    return np.asarray(picture @ np.array([0.299, 0.587, 0.114]))


def halo_of_a_step() -> float:
    """Largest overshoot of local contrast beside steps of one to six stops, as a share of the remaining step.

    The neutral response is one curve for all pixels and cannot make a halo; of the cameras `phone` alone
    acts locally, with a local_contrast of .4.
    """
    fields = ToneFields(local_contrast=0.4)
    worst = 0.0
    for stops in range(1, 7):
        light = np.full((120, 160, 3), 0.05)
        light[:, 80:] *= 2.0**stops
        line = np.log2(flatten_light(light, fields)[60, :, 0])
        near, inner, outer = _HALO_PX
        for beside, far in (
            (line[80 - near : 80], line[80 - outer : 80 - inner]),
            (line[80 : 80 + near], line[80 + inner : 80 + outer]),
        ):
            worst = max(worst, float(np.abs(beside - far.mean()).max() / np.ptp(line)))
    return worst


def write_sheet(pictures: Sequence[Srgb8Image], file: Path, width: int = 3) -> None:
    """A picture of them; width: pictures a row."""
    rows = [np.hstack(pictures[k : k + width]) for k in range(0, len(pictures), width)]
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.vstack([row for row in rows if row.shape == rows[0].shape])).save(file)


if __name__ == "__main__":
    main(sys.argv[1:])
