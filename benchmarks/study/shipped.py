"""The weights that come with the package: trained, judged and packed; and what they are worth.

    python -m benchmarks.study.start_curve render --homes 100   homes, with their labels
    python -m benchmarks.study.shipped                          trainings, cards: an hour of a core
    python -m benchmarks.study.shipped --tasks boundaries       one of them

Normals come from start_curve.py's own trainings; classes and boundaries are trained here on the same homes.
Effects: out/study/curve (drawn homes that judge, rendered where they are missing), out/study/shipped/<task>,
and with --install pbrs_farm/study/weights/<task>. What is trained is kept.
"""

from __future__ import annotations

import argparse
import json
import shutil
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

import pbrs_farm.cli
from benchmarks.study.curve import rendered
from benchmarks.study.kept_rows import Figures
from benchmarks.study.rendered import FOLDER
from benchmarks.study.start_curve import HOMES, held_out

RUNS: Final = FOLDER / "shipped"
PLANS: Final = {
    "segmentation": (
        "steps=1200",
        "batch=16",
        "n_classes=13",
        "average=0.99",
        "zoom=1.3",
        "hue=0.5",
        "threads=1",
        "judge_every=0",
        "final_views=100",
    ),
    "boundaries": (
        "steps=700",
        "batch=8",
        "average=0.99",
        "hue=0.5",
        "threads=1",
        "judge_every=0",
        "final_views=32",
    ),
}
"""Task -> what its plan `lite` is changed by."""
VIEWS: Final = {"segmentation": 1000, "boundaries": 600}
"""Task -> views it trains on, spread over the homes."""
_MEASURES: Final = "made"
_DRAWN: Final = "drawn"
MADE_BY: Final = (
    "python -m benchmarks.study.start_curve render --homes 100",
    "python -m benchmarks.study.shipped",
)
_N_PHOTOGRAPHS: Final = 4

UNITS: Final = {
    "study.weights_mb": "MB, the largest of the weights that come with the package",
    "study.weights_deg": "degrees, mean, of the shipped normals on made homes that never trained; of two seeds they chose the better",
    "study.predict_s": "CPU-s a 640x480 picture, shipped normals; <= 1",
    "study.onnx_equal": "1 = ONNX says what the shipped normals say, within 1e-4",
}


def main(words: Sequence[str] = ()) -> None:
    """Train, judge, pack; install where that is asked for."""
    parser = argparse.ArgumentParser(prog="benchmarks.study.shipped")
    parser.add_argument("--tasks", nargs="+", choices=list(PLANS), default=list(PLANS))
    parser.add_argument("--jobs", type=int, default=1, help="processes that render")
    parser.add_argument("--install", action="store_true", help="into pbrs_farm/study/weights")
    args = parser.parse_args(words)
    place = str(HOMES)
    held, _ = held_out(place)
    judges = {_MEASURES: place, _DRAWN: rendered(_DRAWN, args.jobs)}
    for task in args.tasks:
        run = RUNS / task
        for line in (_training(task, run, place, held), _judging(run, judges)):
            if pbrs_farm.cli.main(line):
                raise RuntimeError(f"{' '.join(line[:2])} failed; what is done is kept")
        from pbrs_farm.study.judging.packed_weights import SHIPPED, pack_weights

        packed = pack_weights(run, run / "packed", made_by=MADE_BY)
        if args.install:
            shutil.copytree(packed.root, SHIPPED / task, dirs_exist_ok=True)


def _training(task: str, run: Path, place: str, held: Sequence[str]) -> list[str]:
    return [
        "train", task, place, "--plan", "lite", "--init", "imagenet", "--hold-out", *held,
        "--views", str(VIEWS[task]), "--out", str(run),
        *(word for field in PLANS[task] for word in ("--set", field)),
    ]  # fmt: skip


def _judging(run: Path, judges: dict[str, str]) -> list[str]:
    on = [word for name, root in judges.items() for word in ("--on", f"{name}={root}")]
    return ["evaluate", str(run), *on]


def shipped_figures() -> Figures:
    """What the weights in the package are: size, error as their card says, seconds, ONNX."""
    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.judging.packed_weights import SHIPPED, shipped_run

    sizes = [path.stat().st_size / 1e6 for path in SHIPPED.glob("*/weights.safetensors")]
    run = open_run(shipped_run("normals"))
    judged = {row["on"]: row for row in json.loads((run.folder.root / "judged.json").read_text())}
    return {
        "study.weights_mb": round(max(sizes), 2),
        "study.weights_deg": judged[_MEASURES]["figures"]["network"]["mean_deg"],
        "study.predict_s": _seconds_a_photograph(run.folder.root),
        "study.onnx_equal": float(_is_equal_in_onnx(run.folder.root)),
    }


def _seconds_a_photograph(root: Path) -> float:
    from pbrs_farm.images import jpeg_from_array
    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.judging.photo_predictions import predict_photographs

    run = open_run(root)
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{k}.jpg" for k in range(_N_PHOTOGRAPHS)]
        for k, path in enumerate(files):
            noise = np.random.default_rng(k).integers(0, 256, (480, 640, 3)).astype(np.uint8)
            path.write_bytes(jpeg_from_array(noise))
        times = []
        for path in files:
            began = time.process_time()
            list(predict_photographs(run, [path], Path(folder) / "seen"))
            times.append(time.process_time() - began)
    return round(statistics.median(times), 3)


def _is_equal_in_onnx(root: Path) -> bool:
    import onnxruntime
    import torch

    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.training.prediction import network_output, write_onnx

    run = open_run(root)
    shape = (1, 3, run.plan.height_px, run.plan.width_px)
    colour = torch.rand(shape, generator=torch.Generator().manual_seed(1))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.onnx"
        with torch.no_grad():
            said = network_output(run.network.eval(), colour, run.plan).numpy()
        write_onnx(run.network, run.plan, path)
        found = onnxruntime.InferenceSession(path).run(["map"], {"colour": colour.numpy()})[0]
    return bool(np.abs(found - said).max() <= 1e-4 * max(1.0, float(np.abs(said).max())))


if __name__ == "__main__":
    main(sys.argv[1:])
