"""Walks, labels between views, pace and lenses -> out/bench/motion.json.

`python -m benchmarks.motion.motion [PART...]`: walks, between, light, pace, lenses; all of them if none is
named. A part's figures stay in out/bench/motion/ and are written again when it is named.
"""

from __future__ import annotations

import importlib
import json
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from benchmarks.figures import write_report

FOLDER: Final = Path("out/bench/motion")
# Part -> its module, with figures() -> name -> value.
PARTS: Final = {
    "walks": "benchmarks.motion.walks",
    "between": "benchmarks.motion.between_views",
    "light": "benchmarks.motion.light_motion",
    "pace": "benchmarks.motion.pace",
    "lenses": "benchmarks.motion.lens_error",
}
UNITS: Final = {
    "flow_error_px": "px, largest of 20 pairs of frames",
    "flow_error_99_px": "px, 99 of 100 pixels",
    "occlusion_wrong": "share of pixels",
    "stereo_error_px": "px, largest",
    "warp_psnr_db": "dB, occluded apart; pictures by the tent filter, linear look-up",
    "warp_psnr_cubic_db": "dB, the same with a cubic look-up",
    "warp_psnr_box_db": "dB, the same of pictures by a box filter, linear look-up",
    "warp_psnr_within_db": "dB, occluded and pixels on an edge of depth apart",
    "light_psnr": "dB, the next frame's denoised light drawn into this one's by flow, one exposure",
    "picture_psnr": "dB, the same of the stored pictures, each with its own exposure",
    "opengl_psnr": "dB, the same of OpenGL-IL",
    "light_s": "CPU s of light and its pictures, a frame of 640x480 by fast",
    "frames_per_s": "frames a second at 640x480: labels, flow, OpenGL",
    "path_blocked": "frames nearer than 10 cm to a surface",
    "walks": "share of homes with a walk of 300 frames",
    "walks_homes": "homes tried",
    "speed_limit": "frames over the limit of speed or turn",
    "light_reuse": "CPU of frames 2.. over that of frame 1",
    "lens_error_px": "px, largest of the models against lens_judge",
    **{
        f"lens_error_px_{name}": "px, largest of 10,000 points"
        for name in ("pinhole", "radtan", "radtan_barrel", "fisheye", "fisheye180", "equirect")
    },
    "lens_error_px_cubemap": "px, largest of 10,000 points",
    "lens_judge": "what projects beside it; panoramas by their definition",
}


def main(words: list[str] | None = None) -> None:
    """Measure the named parts, or all, and write out/bench/motion.json."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for part in words or PARTS:
        if find_spec(PARTS[part]) is None:
            print(f"{part}: no such part here", flush=True)
            continue
        figures = importlib.import_module(PARTS[part]).figures()
        (FOLDER / f"{part}.json").write_text(json.dumps(figures, indent=1) + "\n")
        print(part, json.dumps(figures), flush=True)
    measured: dict[str, Any] = {}
    for part in PARTS:
        file = FOLDER / f"{part}.json"
        measured |= json.loads(file.read_text()) if file.is_file() else {}
    units = {f"motion.{name}": UNITS.get(name, "") for name in measured}
    write_report("motion", {f"motion.{k}": v for k, v in measured.items()}, units)


if __name__ == "__main__":
    main(sys.argv[1:])
