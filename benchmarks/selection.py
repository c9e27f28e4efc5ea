"""Selection at the paper's scale: 779,342 views against 1,449 photographs, streamed from files.

Effects: writes packs of synthetic histograms (under 1 GB) into a temporary folder and
out/bench/selection.json. `python -m benchmarks.selection --views 80000` runs a part of it.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import write_report
from benchmarks.memory import peak_mb
from pbrs_farm.core import keys
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import HistogramFields, SelectionFields
from pbrs_farm.curate.selection_run import json_lines, select
from pbrs_farm.curate.selection_summary import PAPER_VIEWS
from pbrs_farm.formats.histogram_json import SceneQuality
from pbrs_farm.selection import histogram, view_record
from pbrs_farm.selection.binning import BINNINGS
from pbrs_farm.selection.histogram_pack import HistogramPack, bytes_from_pack, pack_from_bytes
from pbrs_farm.selection.histograms import normalised
from pbrs_farm.selection.reference_set import Reference, ReferenceFacts
from pbrs_farm.selection.scores import Scorer, merge_tables
from pbrs_farm.selection.similarity import best_match
from pbrs_farm.selection.verdicts import verdicts
from pbrs_farm.store import MemoryStore

N_PHOTOS = 1449
VIEWS_PER_HOUSE = 17  # 779,342 views of 45,622 houses
N_TEMPLATES = 500
SETTINGS = HistogramFields()
SCENE = SceneQuality(surface=0.4, near=0.0, n_objects=5, noise=0.1)


def synthetic_counts(rng: np.random.Generator, n: int, n_bins: int) -> NDArray[np.uint32]:
    """(n, n_bins) counts like a picture's: few full bins, many empty ones, 307,200 pixels."""
    weights = rng.gamma(0.08, 1.0, (n, n_bins)).astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    return np.asarray(weights * 307_200, np.uint32)


def synthetic_reference() -> Reference:
    """1,449 histograms, compared at the finest binning: 8 x 8 x 8 colours and 128 depths."""
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


def write_packs(folder: Path, n_views: int) -> int:
    """Packs of n_views views, one file per house; their bytes in all.

    The histograms of N_TEMPLATES houses are drawn and repeated under new names: no part of
    scoring knows.
    """
    rng = np.random.default_rng(1)
    n = VIEWS_PER_HOUSE
    quality = np.tile(np.array([0.5, 0, 0.4, 0, 5, 0.1, 0], np.float32), (n, 1))
    templates = []
    for _ in range(N_TEMPLATES):
        colour, depth = (synthetic_counts(rng, n, bins) for bins in (512, 128))
        views = tuple(f"0_{v}_0" for v in range(n))
        none, bedroom, mode = ("",) * n, ("Bedroom",) * n, ("mlt_il_ol",) * n
        classes = ("1:0.5 2:0.2 5:0.1",) * n
        pack = HistogramPack(
            "@" * 32, "s", SETTINGS, views, views, bedroom, mode, none, classes, none,
            colour, depth, quality,
        )  # fmt: skip
        templates.append(bytes_from_pack(pack))
    n_bytes = 0
    for house in range(-(-n_views // n)):
        data = templates[house % N_TEMPLATES].replace(b"@" * 32, f"{house:032x}".encode(), 1)
        n_bytes += (folder / f"{house:06d}.bin").write_bytes(data)
    return n_bytes


def score_folder(folder: Path) -> dict[str, float]:
    """Score, merge and judge every pack of folder in this process; seconds and peak memory."""
    reading = reading_cpu = 0.0

    def packs() -> Iterator[HistogramPack]:
        nonlocal reading, reading_cpu
        for path in sorted(folder.iterdir()):
            started, started_cpu = time.perf_counter(), time.process_time()
            pack = pack_from_bytes(path.read_bytes(), path.name)
            reading += time.perf_counter() - started
            reading_cpu += time.process_time() - started_cpu
            yield pack

    scorer = Scorer(synthetic_reference())
    started, started_cpu = time.perf_counter(), time.process_time()
    tables = list(scorer.score_all(packs()))
    scoring = time.perf_counter() - started - reading
    started = time.perf_counter()
    judged = verdicts(merge_tables(*tables), SelectionFields())
    judging = time.perf_counter() - started
    cpu = time.process_time() - started_cpu - reading_cpu
    started = time.perf_counter()
    n_bytes = len(json_lines(judged))
    assert n_bytes > judged.num_rows
    return {
        "views": judged.num_rows,
        "read_s": reading,
        "score_s": scoring,
        "judge_s": judging,
        "cpu_s": cpu,
        "json_lines_s": time.perf_counter() - started,
        "peak_mb": peak_mb(),
    }


def best_of(n: int, work: Callable[[], Any]) -> float:
    """Seconds of the quickest of n calls."""
    times = []
    for _ in range(n):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return min(times)


def time_libraries() -> dict[str, float]:
    """Seconds each way needs for all views at 512 bins, from a sample of them."""
    from scipy.spatial.distance import cdist

    rng = np.random.default_rng(2)
    references = normalised(synthetic_counts(rng, N_PHOTOS, 512))
    queries = normalised(synthetic_counts(rng, 2048, 512))

    def with_cdist(q: NDArray[np.float32]) -> None:
        cdist(q, references, "cityblock").min(axis=1)

    few = queries[:128]
    seconds = {
        "numpy": best_of(2, lambda: best_match(few, references, library="numpy")) / len(few),
        "scipy": best_of(2, lambda: with_cdist(few)) / len(few),
        "faiss": best_of(3, lambda: best_match(queries, references, library="faiss")) / 2048,
    }
    return {name: s * PAPER_VIEWS for name, s in seconds.items()}


def time_one_view() -> tuple[float, float]:
    """Milliseconds of a 640x480 view's histogram, and of all of histogram.json."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:480, :640]
    smooth = np.stack([x * 0.3 + 20, y * 0.4, (x + y) * 0.15 + 40], axis=-1)
    rgb = np.clip(smooth + rng.normal(0, 4, smooth.shape), 0, 255).astype(np.uint8)
    depth = (1500 + 4 * x + 3 * y).astype(np.uint16)
    place = {"house": "h", "view": "0_0_0", "room": "0_0", "room_type": "Bedroom"}
    counting = best_of(20, lambda: histogram(rgb, depth, SETTINGS))
    whole = best_of(
        20, lambda: view_record(place, {Mode.MLT_IL_OL: rgb}, depth, SCENE, SETTINGS).json_bytes()
    )
    return 1000 * counting, 1000 * whole


def time_one_house(n_views: int = 30) -> float:
    """Seconds of `select` for one new house: read histogram.json files, score, judge, write."""
    rng, store, reference = np.random.default_rng(4), MemoryStore(), synthetic_reference()
    for k in range(n_views):
        rgb = rng.integers(0, 256, (48, 64, 3), np.uint8)
        depth = rng.integers(500, 6000, (48, 64)).astype(np.uint16)
        place = {"house": "h", "view": f"0_{k}_0", "room": f"0_{k}", "room_type": "Bedroom"}
        data = view_record(place, {Mode.MLT_IL_OL: rgb}, depth, SCENE, SETTINGS).json_bytes()
        store.put(keys.view_key("h", place["view"], "histogram.json"), data)

    def once() -> None:
        for key in list(store.list("selection/")):
            store.delete(key)
        assert select(store, reference, SelectionFields()).n_scored_houses == 1

    return best_of(3, once)


def main(n_views: int = PAPER_VIEWS) -> None:
    """Run all, print the table, write the report."""
    with tempfile.TemporaryDirectory(prefix="pbrs-selection-") as folder:
        started = time.perf_counter()
        n_bytes = write_packs(Path(folder), n_views)
        print(f"{n_views:,} views written: {n_bytes / 1e6:,.0f} MB, {_since(started):.0f} s")
        command = [sys.executable, "-m", "benchmarks.selection", "--score", folder]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    part = json.loads(done.stdout)
    scale = n_views / part["views"]
    print(f"\n{'512 bins, all views against 1,449':<36}{'seconds (from a sample)':>24}")
    for name, seconds in time_libraries().items():
        print(f"{name:<36}{seconds:>24,.0f}")
    counting, whole = time_one_view()
    figures = {
        "selection.views": n_views,
        "selection.paper_scale_s": round(scale * (part["score_s"] + part["judge_s"]), 1),
        "selection.cpu_s": round(scale * part["cpu_s"], 1),
        "selection.read_s": round(part["read_s"], 1),
        "selection.json_lines_s": round(part["json_lines_s"], 1),
        "selection.peak_mb": round(part["peak_mb"]),
        "selection.histogram_ms": round(counting, 2),
        "selection.record_ms": round(whole, 2),
        "selection.house_s": round(time_one_house(), 3),
    }
    units = {
        "selection.views": "views scored",
        "selection.paper_scale_s": "s, scoring and judging, reading apart",
        "selection.cpu_s": "s of processor time for the same, all threads",
        "selection.read_s": "s, reading and unpacking the houses' files",
        "selection.json_lines_s": "s, the run as JSON lines",
        "selection.peak_mb": "MB of the scoring process",
        "selection.histogram_ms": "ms per 640x480 view",
        "selection.record_ms": "ms per 640x480 view, quality and JSON too",
        "selection.house_s": "s for a new house of 30 views",
    }
    print()
    write_report("selection", figures, units)


def _since(started: float) -> float:
    return time.perf_counter() - started


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--views", type=int, default=PAPER_VIEWS)
    parser.add_argument("--score", type=Path, help="score this folder of packs, print JSON")
    arguments = parser.parse_args()
    if arguments.score:
        print(json.dumps(score_folder(arguments.score)))
    else:
        main(arguments.views)
