"""Selection at the paper's scale: `make bench NAME=selection` -> out/bench/selection.json.

Scores and judges a tenth of 779,342 synthetic views against 1,449 photographs, 512 colour and 128 depth bins, in a
new process; time is proportional to views. Effects: writes 80 MB of histogram packs into a temporary folder.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import write_report
from benchmarks.memory import peak_mb
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.curate.selection_summary import PAPER_VIEWS
from pbrs_farm.formats.histogram_json import SceneQuality
from pbrs_farm.selection.binning import BINNINGS
from pbrs_farm.selection.histogram_pack import HistogramPack, bytes_from_pack, pack_from_bytes
from pbrs_farm.selection.reference_set import Reference, ReferenceFacts
from pbrs_farm.selection.scores import Scorer, merge_tables
from pbrs_farm.selection.verdicts import verdicts

SHARE: Final = 0.1
N_PHOTOS: Final = 1449
VIEWS_PER_HOUSE: Final = 17
N_TEMPLATES: Final = 100  # different houses; the others repeat their histograms
SETTINGS: Final = HistogramFields()
SCENE: Final = SceneQuality(surface=0.4, near=0.0, n_objects=5, noise=0.1)
UNITS: Final = {
    "selection.views": "views scored",
    "selection.paper_scale_s": "s to score and judge 779,342 views, without reading",
    "selection.read_s": "s to read and unpack their files",
    "selection.peak_mb": "MB of the scoring process",
}


def main() -> None:
    """Measure and write out/bench/selection.json."""
    with tempfile.TemporaryDirectory(prefix="pbrs-selection-") as folder:
        write_packs(Path(folder), round(SHARE * PAPER_VIEWS))
        command = [sys.executable, "-m", "benchmarks.selection", folder]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    part = json.loads(done.stdout)
    scale = PAPER_VIEWS / part["views"]
    figures = {
        "selection.views": part["views"],
        "selection.paper_scale_s": round(scale * part["judged_s"], 1),
        "selection.read_s": round(scale * part["read_s"], 1),
        "selection.peak_mb": round(part["peak_mb"]),
    }
    write_report("selection", figures, UNITS)


def synthetic_counts(rng: np.random.Generator, n: int, n_bins: int) -> NDArray[np.uint32]:
    """(n, n_bins) counts like a picture's: few full bins, many empty ones, 307,200 pixels."""
    weights = rng.gamma(0.08, 1.0, (n, n_bins)).astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    return np.asarray(weights * 307_200, np.uint32)


def synthetic_reference() -> Reference:
    """1,449 histograms with the finest binning."""
    rng = np.random.default_rng(0)
    facts = ReferenceFacts(
        source="synthetic",
        source_sha256="0" * 64,
        settings=SETTINGS,
        binning=BINNINGS[-1],
        table=(),
        ids=tuple(f"{k + 1:04d}" for k in range(N_PHOTOS)),
    )
    colour, depth = (synthetic_counts(rng, N_PHOTOS, n) for n in (512, 128))
    return Reference(facts, colour, depth)


def write_packs(folder: Path, n_views: int) -> None:
    """Write packs of n_views views or a few more, a file per house."""
    rng = np.random.default_rng(1)
    n = VIEWS_PER_HOUSE
    quality = np.tile(np.array([0.5, 0, 0.4, 0, 5, 0.1, 0], np.float32), (n, 1))
    templates = []
    for _ in range(N_TEMPLATES):
        colour, depth = (synthetic_counts(rng, n, bins) for bins in (512, 128))
        views = tuple(f"0_{v}_0" for v in range(n))
        empty, bedroom, mode = ("",) * n, ("Bedroom",) * n, ("mlt_il_ol",) * n
        classes = ("1:0.5 2:0.2 5:0.1",) * n
        pack = HistogramPack(
            "@" * 32, "s", SETTINGS, views, views, bedroom, mode, empty, classes, empty,
            colour, depth, quality,
        )  # fmt: skip
        templates.append(bytes_from_pack(pack))
    for house in range(-(-n_views // n)):
        data = templates[house % N_TEMPLATES].replace(b"@" * 32, f"{house:032x}".encode(), 1)
        (folder / f"{house:06d}.bin").write_bytes(data)


def score_folder(folder: Path) -> dict[str, float]:
    """Score, merge and judge every pack of folder in this process; seconds and peak memory."""
    read_s = 0.0

    def packs() -> Iterator[HistogramPack]:
        nonlocal read_s
        for path in sorted(folder.iterdir()):
            started = time.perf_counter()
            pack = pack_from_bytes(path.read_bytes(), path.name)
            read_s += time.perf_counter() - started
            yield pack

    scorer = Scorer(synthetic_reference())
    started = time.perf_counter()
    judged = verdicts(merge_tables(*scorer.score_all(packs())), SelectionFields())
    seconds = time.perf_counter() - started - read_s
    return {"views": judged.num_rows, "read_s": read_s, "judged_s": seconds, "peak_mb": peak_mb()}


if __name__ == "__main__":
    if len(sys.argv) > 1:
        print(json.dumps(score_folder(Path(sys.argv[1]))))
    else:
        main()
