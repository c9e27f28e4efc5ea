"""Costs of the study and errors of the weights that ship: `make bench NAME=study` -> out/bench/study.json.

Reads views from files and from shards, scores one boundary picture, and runs the shipped normals.
Effects: renders four views of the built-in home into out/study/loading.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy import ndimage

import pbrs_farm
from benchmarks.figures import write_report
from benchmarks.study.shipped import FOLDER
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.images import jpeg_from_array
from pbrs_farm.study.judging.packed_weights import shipped_run, weights_folder
from pbrs_farm.study.metrics.edge_scores import edge_counts
from pbrs_farm.study.training_plan import PLANS, TASKS, plan_of
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.view_sample import SampleRequest
from pbrs_farm.views.views import Views

_ROOMS: Final = ("desk", "garage", "plant")
_KINDS: Final = ("up", "frontal", "oblique", "slanted")
_TIMED_PLANS: Final = ("tiny", "lite")
UNITS: Final = {
    "study.loader_views_s": "views per CPU-s: colour, normal, valid at 640x480 from files, best of 5 rounds",
    "study.packed_views_s": "the same at 320x240 from shards, colour as PNG",
    "study.packed_jpeg_views_s": "the same, colour as JPEG of quality 95",
    "study.packed_kb": "KB a view in shards, colour as PNG",
    "study.packed_jpeg_kb": "KB a view in shards, colour as JPEG",
    "study.boundary_core_s": "CPU-s to score a 425x560 picture at 33 thresholds",
    "study.weights_mb": "MB of the largest weights that ship",
    "study.weights_deg": "degrees, mean error of the shipped normals on held-out generated homes, from their card",
    "study.weights_iou": "mean IoU of the shipped classes on them, from their card",
    "study.weights_ods": "ODS of the shipped boundaries on them, from their card",
    "study.predict_s": "CPU-s of the shipped normals for a picture of 640x480 with the mirror, median of 4",
    "study.photo_normals": "degrees, mean error of the shipped normals over the rooms of the free pairs, with the mirror",
    "study.photo_normals_plain": "the same without the mirror",
    "study.photo_planes": "degrees, with the mirror, by large planes",
    "study.photo_floor": "degrees, floor of the truth of the free pairs",
    **{f"study.photo_{room}": f"degrees, with the mirror, on the {room}" for room in _ROOMS},
    **{
        f"study.photo_{kind}": f"degrees, with the mirror, where surfaces are {kind}"
        for kind in _KINDS
    },
    **{
        f"study.made_{kind}": f"degrees, on held-out generated homes, where surfaces are {kind}"
        for kind in _KINDS
    },
    **{
        f"study.{plan}_{task}_min": f"CPU-minutes of a training of {task} by plan {plan}, by five of its steps"
        for plan in _TIMED_PLANS
        for task in TASKS
    },
    "study.onnx_equal": "1: ONNX Runtime gives the shipped normals within 1e-4",
    "study.detector_small": "share of whole cups, bowls, bottles and vases of .06 to .12 of the picture that CenterNet finds",
}
_MODE: Final = "mlt_il_ol"
_LAYERS: Final = ("colour", "normal")  # valid comes with normal
_N_READ, _N_ROUNDS, _N_PICTURES = 40, 5, 4


def main() -> None:
    """Measure and write out/bench/study.json; detector figures only after a detector run."""
    figures = loading_figures() | {"study.boundary_core_s": boundary_cpu_s()}
    figures |= weights_figures() | photo_figures() | training_figures()
    write_report("study", figures | detector_figures(), UNITS)


def loading_figures() -> dict[str, float]:
    """Read rates of views from files and from shards."""
    with tempfile.TemporaryDirectory() as folder:
        views = pbrs_farm.open(_rendered(FOLDER / "loading"))
        figures = {"study.loader_views_s": _views_per_cpu_s(views)}
        for colour, name in (("png", ""), ("jpeg", "_jpeg")):
            shards = Path(folder) / colour
            packed = pack(views, shards, Packing((320, 240), _LAYERS, (_MODE,), colour=colour))
            figures[f"study.packed{name}_views_s"] = _views_per_cpu_s(pbrs_farm.open(shards))
            figures[f"study.packed{name}_kb"] = round(packed.n_bytes / len(views) / 1000, 1)
    return figures


def _rendered(root: Path) -> Path:
    words = ["run", "builtin", "--out", str(root), "--recipe", "preview", "--size", "640x480"]
    words += ["--views", "4", "--modes", _MODE, "--set", "light.spp=4"]
    subprocess.run(
        [sys.executable, "-m", "pbrs_farm.cli", *words], check=True, stdout=subprocess.DEVNULL
    )
    return root


def _views_per_cpu_s(views: Views) -> float:
    request, best_s = SampleRequest(_LAYERS, _MODE), float("inf")
    views[0].sample(request)
    for _round in range(_N_ROUNDS):
        started = time.process_time()
        for k in range(_N_READ):
            views[k % len(views)].sample(request)
        best_s = min(best_s, time.process_time() - started)
    return round(_N_READ / best_s, 1)


def boundary_cpu_s() -> float:
    """CPU-s to match boxes' edges, shifted, blurred and noisy, with 9,000 true edge pixels."""
    rng = np.random.default_rng(0)
    labels = np.zeros((425, 560), int)
    for k in range(1, 70):
        row, column = rng.integers(0, 425), rng.integers(0, 560)
        height, width = rng.integers(20, 140, 2)
        labels[row : row + height, column : column + width] = k
    truth = np.zeros(labels.shape, bool)
    truth[:, :-1] |= labels[:, :-1] != labels[:, 1:]
    truth[:-1] |= labels[:-1] != labels[1:]
    soft = ndimage.gaussian_filter(np.roll(truth, 2, 1).astype(float), 1.5) * 2
    strength = soft + ndimage.gaussian_filter(rng.random(labels.shape), 2) / 2
    started = time.process_time()
    edge_counts(strength / strength.max(), truth)
    return round(time.process_time() - started, 2)


def weights_figures() -> dict[str, float]:
    """Size, judged error, speed and ONNX of the weights in the package."""
    sizes = [path.stat().st_size / 1e6 for path in weights_folder().glob("*/weights.safetensors")]
    return {
        "study.weights_mb": round(max(sizes), 2),
        "study.weights_deg": _judged("normals")["mean_deg"],
        "study.weights_iou": _judged("segmentation")["mean_iou"],
        "study.weights_ods": _judged("boundaries")["ods"],
        **{
            f"study.made_{kind}": round(_made("normals")["parts"]["network"][kind], 2)
            for kind in _KINDS
        },
        "study.predict_s": _predict_cpu_s(),
        "study.onnx_equal": float(_is_equal_in_onnx()),
    }


def _judged(task: str) -> dict[str, float]:
    figures: dict[str, float] = _made(task)["figures"]["network"]
    return figures


def _made(task: str) -> dict[str, Any]:
    """The evaluation on held-out generated homes that comes with the weights."""
    rows = json.loads((shipped_run(task) / "judged.json").read_text())
    (row,) = (row for row in rows if row["on"] == "made")
    return dict(row)


def photo_figures() -> dict[str, float]:
    """Errors of the shipped normals on the free pairs; {} if they cannot be fetched."""
    from benchmarks.study.free_pairs import free_pairs
    from pbrs_farm.study.judging.evaluation import FLOOR, LARGE_PLANES, evaluate, open_run
    from pbrs_farm.study.judging.judged_places import open_judged_place

    try:
        folder = free_pairs()
    except (OSError, subprocess.CalledProcessError, PbrsError) as error:
        print(f"study.photo_normals: not measured, the pairs cannot be fetched: {error}")
        return {}
    run = open_run(shipped_run("normals"))
    views = open_judged_place(str(folder), run.plan, mode=_MODE)
    plain, mirrored = (evaluate(run, views, mirror=mirror) for mirror in (False, True))
    kinds = mirrored.parts["network"].means_deg()
    figures = {
        "normals": mirrored.over_rooms("network"),
        "normals_plain": plain.over_rooms("network"),
        "planes": mirrored.over_rooms("network" + LARGE_PLANES),
        "floor": mirrored.over_rooms(FLOOR),
        **mirrored.groups,
        **{kind: kinds[kind] for kind in _KINDS},
    }
    return {f"study.photo_{name}": round(value, 2) for name, value in figures.items()}


def training_figures() -> dict[str, float]:
    """CPU-minutes of a training of each task, from the median of five of its steps."""
    return {
        f"study.{plan}_{task}_min": round(_step_cpu_s(task, plan) * PLANS[plan, task].steps / 60, 1)
        for plan in _TIMED_PLANS
        for task in TASKS
    }


def _step_cpu_s(task_name: str, plan_name: str) -> float:
    import torch

    from pbrs_farm.study.networks.network_choice import network_of
    from pbrs_farm.study.tasks.tasks import task_of
    from pbrs_farm.study.training.run_folder import RunFolder
    from pbrs_farm.study.training.training_loop import Share, train_network
    from pbrs_farm.study.training.training_views import ViewArrays

    plan = plan_of(task_name, plan_name, {"steps": "6", "log_every": "1", "judge_every": "0"})
    task, n = task_of(task_name), plan.batch
    torch.set_num_threads(1)
    pictures = np.random.default_rng(0).integers(0, 256, (n, 120, 160, 3)).astype(np.uint8)
    flat = pictures[..., 0] % 13 + 1
    targets = {
        "normals": {"normal": pictures.astype(np.int16), "valid": flat > 0},
        "segmentation": {"labels": flat},
        "boundaries": {"edges": flat > 12},
        "depth": {"depth": flat.astype(np.float32)},
    }[task_name]
    views = ViewArrays(tuple(map(str, range(n))), pictures, targets)
    times = [time.process_time()]
    with tempfile.TemporaryDirectory() as folder:
        train_network(
            network_of(plan.network, task.n_out(plan), rays=plan.rays), views, task, plan, seed=0,
            folder=RunFolder(Path(folder)), share=Share(),
            observe=lambda _row: times.append(time.process_time()), judge=lambda _network: {},
        )  # fmt: skip
    return statistics.median(np.diff(times)[1:].tolist())


def _predict_cpu_s() -> float:
    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.judging.photo_predictions import predict_photographs

    run, times = open_run(shipped_run("normals")), []
    with tempfile.TemporaryDirectory() as folder:
        for k in range(_N_PICTURES):
            picture = Path(folder) / f"{k}.jpg"
            noise = np.random.default_rng(k).integers(0, 256, (480, 640, 3)).astype(np.uint8)
            picture.write_bytes(jpeg_from_array(noise))
            started = time.process_time()
            list(predict_photographs(run, [picture], Path(folder) / "out", mirror=True))
            times.append(time.process_time() - started)
    return round(statistics.median(times), 3)


def _is_equal_in_onnx() -> bool:
    import onnxruntime
    import torch

    from pbrs_farm.study.judging.evaluation import open_run
    from pbrs_farm.study.training.prediction import network_output, write_onnx

    run = open_run(shipped_run("normals"))
    shape = (1, 3, run.plan.height_px, run.plan.width_px)
    colour = torch.rand(shape, generator=torch.Generator().manual_seed(1))
    with tempfile.TemporaryDirectory() as folder, torch.no_grad():
        path = Path(folder) / "model.onnx"
        ours = network_output(run.network.eval(), colour, run.plan).numpy()
        write_onnx(run.network, run.plan, path)
        theirs = onnxruntime.InferenceSession(path).run(["map"], {"colour": colour.numpy()})[0]
    return bool(np.abs(theirs - ours).max() <= 1e-4 * max(1.0, float(np.abs(ours).max())))


def detector_figures() -> dict[str, Any]:
    """Recall of small vessels from an earlier run of the detector; {} without one."""
    from benchmarks.study import detector

    if not detector.RESULTS.exists():
        print("study.detector_small: not measured; run python -m benchmarks.study.detector ROOT")
        return {}
    return detector.detector_figures(json.loads(detector.RESULTS.read_text()))


if __name__ == "__main__":
    main()
