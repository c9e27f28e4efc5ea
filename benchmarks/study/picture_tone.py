"""Tones of our pictures beside those of photographs of rooms: `make bench NAME=tone` -> out/bench/tone.json.

Views of generated homes that nobody saw while the tone was set, 320x240, recipe fast. Highlights are counted without windows
and the view through them, which photographs of rooms overexpose too. Effects: renders below out/tone; writes a sheet of the
six worst views, out/tone/worst.png.

    python -m benchmarks.study.picture_tone             those homes
    python -m benchmarks.study.picture_tone ROOT...     finished views of other output folders
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

import pbrs_farm.cli
from benchmarks.figures import write_report
from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.recipe import ToneFields
from pbrs_farm.transport.develop.tone_mapping import flatten_light
from pbrs_farm.views.open_views import open_views
from pbrs_farm.views.views import Frame

HOMES: Final = "made:60041..60046"
N_VIEWS: Final = 4  # of each
OUT: Final = Path("out/tone")
N_WORST: Final = 6
_HALO_PX: Final = (
    2,
    6,
    12,
)  # from a step: beside it up to the first, undisturbed between the others

UNITS: Final = {
    "tone.sd": "of 255: standard deviation of luma within a picture; photographs 67",
    "tone.dark": "share of pixels whose luma is below 20; photographs .073",
    "tone.black": "share of pixels whose luma is below 3; photographs .006",
    "tone.blown": "share of pixels above 245, windows and what is behind them left out; photographs .038 with them",
    "tone.blown_worst": "the same of the worst view",
    "tone.p1": "of 255: luma that 1 % of the pixels are below; photographs 8.7",
    "tone.p95": "of 255: luma that 5 % of the pixels are above; photographs 231",
    "tone.chroma": "of 255: largest minus least channel, mean; photographs 28",
    "tone.halo": "largest share of a step of light that local contrast of .4 adds beside it",
    "tone.views": "views measured",
}


def main(places: Sequence[str] = ()) -> None:
    """Render missing views, measure, write the figures and the sheet."""
    views = [frame for place in places or [_rendered()] for frame in open_views(place)]
    rows = np.array(
        [picture_row(frame.picture("mlt_il_ol"), window_mask(frame)) for frame in views]
    )
    sd, dark, black, blown, p1, p95, chroma = rows.mean(axis=0).tolist()
    figures = {
        "tone.sd": round(sd, 1),
        "tone.dark": round(dark, 4),
        "tone.black": round(black, 4),
        "tone.blown": round(blown, 4),
        "tone.blown_worst": round(float(rows[:, 3].max()), 4),
        "tone.p1": round(p1, 2),
        "tone.p95": round(p95, 1),
        "tone.chroma": round(chroma, 1),
        "tone.halo": round(halo_of_a_step(), 4),
        "tone.views": len(views),
    }
    worst = np.argsort(rows[:, 2] + rows[:, 3])[::-1][:N_WORST]
    write_sheet([views[k].picture("mlt_il_ol") for k in worst], OUT / "worst.png")
    for k in worst:
        print(f"{views[k].id}: black {rows[k, 2]:.3f}, blown {rows[k, 3]:.3f}, p1 {rows[k, 4]:.0f}")
    write_report("tone", figures, UNITS)


def _rendered() -> str:
    words = ["--dress", "1", "--size", "320x240", "--views", str(N_VIEWS), "--modes", "mlt_il_ol"]
    words += ["--layers", "glass", "--recipe", "fast"]
    if pbrs_farm.cli.main(["run", HOMES, *words, "--out", str(OUT / "views")]):
        raise RuntimeError("some views failed")
    return str(OUT / "views")


def window_mask(frame: Frame) -> F64:
    """(H, W) True for panes, pixels behind them, and pixels without a surface."""
    glass = (
        frame.layer("glass") > 0 if "glass" in frame.layers else np.zeros(frame.depth.shape, bool)
    )
    return np.asarray(glass | (frame.depth == 0))


def picture_row(picture: Srgb8Image, is_window: F64) -> F64:
    """(7,) sd, dark, black, blown, p1, p95 and chroma of one picture, as UNITS says."""
    rgb = picture.astype(np.float64)
    luma = rgb @ np.array([0.299, 0.587, 0.114])
    blown = (luma > 245) & ~is_window
    p1, p95 = np.percentile(luma, [1, 95])
    chroma = (rgb.max(axis=-1) - rgb.min(axis=-1)).mean()
    return np.array(
        [luma.std(), (luma < 20).mean(), (luma < 3).mean(), blown.mean(), p1, p95, chroma]
    )


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


def write_sheet(pictures: Sequence[Srgb8Image], file: Path) -> None:
    """A picture of up to six, three a row."""
    rows = [np.hstack(pictures[k : k + 3]) for k in range(0, len(pictures), 3)]
    file.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.vstack([row for row in rows if row.shape == rows[0].shape])).save(file)


if __name__ == "__main__":
    main(sys.argv[1:])
