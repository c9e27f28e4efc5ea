"""The weights that come with the package: trained, judged and packed; and what they are worth.

    python -m benchmarks.study.shipped                    homes, trainings, cards: two hours of a core
    python -m benchmarks.study.shipped --tasks boundaries one of them

Normals come from benchmarks/study/start_curve.py; those that are trained here are what segmentation
starts from, and do not ship.
Effects: out/study/curve (homes of the learning curve, rendered where they are missing),
out/study/shipped/<task>, and with --install pbrs_farm/study/weights/<task>. What is trained is kept.
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
from benchmarks.study.curve import JUDGES, rendered, roots_of_homes
from benchmarks.study.kept_rows import Figures
from benchmarks.study.rendered import FOLDER

RUNS: Final = FOLDER / "shipped"
HOMES: Final = {"normals": 80, "segmentation": 80, "boundaries": 20}
"""Task -> how many homes of the learning curve it trains on, ten views of each."""
PLANS: Final = {
    "normals": ("steps=2400", "judge_every=1200", "final_views=100", "bf16=true"),
    "segmentation": (
        "steps=1600",
        "judge_every=800",
        "final_views=100",
        "bf16=true",
        "n_classes=13",
        "average=0.99",
    ),
    # Lines are a pixel wide: at the views' own size.
    "boundaries": (
        "width_px=160",
        "height_px=120",
        "bf16=true",
        "steps=700",
        "judge_every=350",
        "final_views=16",
        "average=0.99",
        "hue=0.5",
    ),
}
"""Task -> what its plan `tiny` is changed by."""
_COMMON: Final = ("threads=1", "width_px=96", "height_px=72")
# The judge that chooses the step where a task has few views; the other one measures.
_CHOOSES: Final = {"boundaries": "drawn"}
_MEASURES: Final = "made"
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
    judges = {name: rendered(name, args.jobs) for name in JUDGES}
    # Segmentation starts from normals of the same homes.
    first = ["normals"] if "segmentation" in args.tasks and "normals" not in args.tasks else []
    for task in [*first, *args.tasks]:
        run = RUNS / task
        homes = [rendered(name, args.jobs) for name in roots_of_homes(HOMES[task])]
        for line in (_training(task, run, homes, judges), _judging(run, judges)):
            if pbrs_farm.cli.main(line):
                raise RuntimeError(f"{' '.join(line[:2])} failed; what is done is kept")
        from pbrs_farm.study.judging.packed_weights import SHIPPED, pack_weights

        packed = pack_weights(run, run / "packed", made_by=("python -m benchmarks.study.shipped",))
        if args.install and task != "normals":
            shutil.copytree(packed.root, SHIPPED / task, dirs_exist_ok=True)


def _training(task: str, run: Path, homes: Sequence[str], judges: dict[str, str]) -> list[str]:
    words = ["train", task, *homes, "--hold-out", "none", "--out", str(run)]
    if task == "segmentation":  # few views show enough of each class
        words += ["--init", str(RUNS / "normals")]
    if judge := _CHOOSES.get(task):
        words += ["--on", f"{judge}={judges[judge]}", "--stop-on", judge]
    return words + [word for field in (*_COMMON, *PLANS[task]) for word in ("--set", field)]


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
