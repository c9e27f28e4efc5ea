"""How many views a core reads in a second: from files at 640x480, from shards at 320x240.

Effects: renders four views of the built-in home into out/study/loading, or reads a root that is
named, and writes out/bench/loading.json. `python -m benchmarks.study.loading [ROOT]`.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pbrs_farm
from benchmarks.figures import write_report
from benchmarks.study.rendered import FOLDER
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.view_sample import SampleRequest
from pbrs_farm.views.views import Views

N_READ, N_ROUNDS = 40, 5
MODE = "mlt_il_ol"
LAYERS = ("colour", "normal")  # valid comes with normal
UNITS = {
    "study.loader_views_s": "views per CPU-s: colour, normal, valid at 640x480 from files, the best of 5 rounds of 40",
    "study.packed_views_s": "the same at 320x240 from shards, colour as PNG",
    "study.packed_jpeg_views_s": "the same, colour as JPEG of quality 95 by Pillow",
    "study.packed_kb": "KB a view in these shards, colour as PNG",
    "study.packed_jpeg_kb": "KB a view, colour as JPEG",
}


def main() -> None:
    """Measure and write out/bench/loading.json."""
    root = Path(sys.argv[1]) if len(sys.argv) == 2 and Path(sys.argv[1]).is_dir() else None
    write_report("loading", loading_figures(root), UNITS)


def loading_figures(root: Path | None = None) -> dict[str, float]:
    """The figures of UNITS; root: rendered at 640x480 in mlt_il_ol, None to render one."""
    with tempfile.TemporaryDirectory() as folder:
        views = pbrs_farm.open(root or _rendered(FOLDER / "loading"))
        figures = {"study.loader_views_s": _rate(views)}
        for colour, name in (("png", ""), ("jpeg", "_jpeg")):
            out = Path(folder) / colour
            packed = pack(views, out, Packing((320, 240), LAYERS, (MODE,), colour=colour))
            figures[f"study.packed{name}_views_s"] = _rate(pbrs_farm.open(out))
            figures[f"study.packed{name}_kb"] = round(packed.n_bytes / len(views) / 1000, 1)
    return figures


def _rendered(root: Path) -> Path:
    words = ["run", "builtin", "--out", str(root), "--recipe", "preview", "--size", "640x480"]
    words += ["--views", "4", "--modes", MODE, "--set", "light.spp=16"]
    words = [sys.executable, "-m", "pbrs_farm.cli", *words]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{root}: {done.stderr[-500:]}")
    return root


def _rate(views: Views) -> float:
    request, best_s = SampleRequest(LAYERS, MODE), float("inf")
    views[0].sample(request)
    for _round in range(N_ROUNDS):
        started = time.process_time()
        for k in range(N_READ):
            views[k % len(views)].sample(request)
        best_s = min(best_s, time.process_time() - started)
    return round(N_READ / best_s, 1)


if __name__ == "__main__":
    main()
