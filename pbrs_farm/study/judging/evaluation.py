"""A finished run judged on views: figures beside the baseline, HED untouched and the paper. Effects: reads the run."""

from __future__ import annotations

import hashlib
import math
import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from torch import nn

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.study.metrics.edge_scores import EXACT_THRESHOLDS
from pbrs_farm.study.networks.initial_weights import has_hed, start_from
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.tasks.study_task import Arrays, StudyTask
from pbrs_farm.study.tasks.tasks import N_THRESHOLDS, EdgesTask, task_of
from pbrs_farm.study.training.checkpoint import load_checkpoint
from pbrs_farm.study.training.prediction import Judged, placed, predicted, scored
from pbrs_farm.study.training.run_folder import RunFolder, finished_run
from pbrs_farm.study.training.training_views import ViewArrays
from pbrs_farm.study.training.view_sources import NYU_LIGHT
from pbrs_farm.study.training_plan import TrainingPlan, plan_of

# Figures as Markdown tables: what was judged on what, beside baseline and paper; pure.


UNDERFIT: Final = 0.8  # training error above this share of the baseline's: nothing may be ranked

_UNITS: Final = ("_deg", "_m")  # that names of figures end with; others are shares
_TITLES: Final = {
    "mean_deg": "mean, degrees", "median_deg": "median, degrees",
    "rms_deg": "RMS, degrees", "below_5": "< 5", "below_7_5": "< 7.5",
    "below_11_25": "< 11.25", "below_22_5": "< 22.5", "below_30": "< 30",
    "mean_iou": "mean IoU", "pixel_accuracy": "pixel accuracy",
    "mean_accuracy": "mean accuracy", "weighted_iou": "f.w. IoU",
    "scale_invariant": "scale-invariant", "abs_rel": "absolute relative",
    "below_1_25": "ratio < 1.25", "rms_m": "RMS, metres",
    "ods": "ODS", "ois": "OIS", "ap": "AP", "r50": "R50",
}  # fmt: skip


def title_of(figure: str) -> str:
    """A figure's name as tables have it."""
    return _TITLES[figure]


def shown_figure(figure: str, value: float) -> str:
    """Degrees and metres with two places, shares as per cent with one; "-" for none."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.2f}" if figure.endswith(_UNITS) else f"{100 * value:.1f} %"


def spread_text(figure: str, values: Sequence[float]) -> str:
    """Mean and, of several seeds, the standard deviation of a sample."""
    mean = shown_figure(figure, statistics.fmean(values))
    if len(values) < 2:
        return mean
    scale = 1 if figure.endswith(_UNITS) else 100
    return f"{mean} ± {scale * statistics.stdev(values):.2f}"


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table whose columns are as wide as their widest cell."""
    cells = [list(head), *(list(row) for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
    lines = [
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) + " |"
        for row in cells
    ]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    return "\n".join([lines[0], rule, *lines[1:]])


def is_underfit(train_error: float, baseline_error: float) -> bool:
    """The network hardly knows its own training views: no conclusion may be drawn from it."""
    return train_error > UNDERFIT * baseline_error


# The numbers of the paper's tables, by task and figure.
# Zhang et al. 2017, tables 1 to 3, NYUv2's test split. They stand beside ours and are never mixed
# with them: other pictures, other truth, 568,793 views and days of a GPU.


@dataclass(frozen=True, slots=True)
class PaperRow:
    """A row of the paper: what it was trained on, and its figures in the order of Task.figures."""

    pretrained: str
    tuned: str
    figures: tuple[float, ...]


PAPER: Final[dict[str, tuple[PaperRow, ...]]] = {
    # Mean, median, and shares below 11.25, 22.5, 30 degrees.
    "normals": (
        PaperRow("NYUv2 only", "", (27.30, 21.12, 0.2721, 0.5261, 0.6472)),
        PaperRow("MLT object", "", (48.78, 47.49, 0.0356, 0.1279, 0.2135)),
        PaperRow("MLT-OL", "", (49.33, 42.30, 0.0747, 0.2324, 0.3409)),
        PaperRow("MLT-IL/OL", "", (27.90, 21.29, 0.2676, 0.5221, 0.6375)),
        PaperRow("OpenGL-DL", "", (34.02, 28.00, 0.1856, 0.4114, 0.5290)),
        PaperRow("OpenGL-IL", "", (33.06, 26.68, 0.2089, 0.4346, 0.5466)),
        PaperRow("OpenGL-IL", "NYUv2", (23.38, 16.12, 0.3598, 0.6293, 0.7317)),
        PaperRow("MLT-IL/OL", "NYUv2", (21.74, 14.75, 0.3937, 0.6625, 0.7606)),
    ),
    # Mean IoU alone is reported.
    "segmentation": (
        PaperRow("ImageNet (Yu et al.)", "NYUv2", (0.317,)),
        PaperRow("ImageNet + OpenGL", "NYUv2", (0.328,)),
        PaperRow("ImageNet + MLT", "NYUv2", (0.332,)),
    ),
    # ODS, OIS, AP, R50; the R50 of the first row cannot go with its ODS and AP.
    "boundaries": (
        PaperRow("NYUv2 only", "", (0.713, 0.725, 0.711, 0.267)),
        PaperRow("OpenGL-IL", "", (0.523, 0.555, 0.511, 0.504)),
        PaperRow("MLT-IL/OL", "", (0.604, 0.621, 0.587, 0.749)),
        PaperRow("OpenGL-IL", "NYUv2", (0.716, 0.729, 0.715, 0.893)),
        PaperRow("MLT-IL/OL", "NYUv2", (0.725, 0.736, 0.720, 0.887)),
    ),
}

_PAPER_CLASSES: Final = 40  # of segmentation
# Lighting mode -> its name in the paper.
_NAMES: Final = {"mlt_il_ol": "MLT-IL/OL", "mlt_ol": "MLT-OL", "opengl_il": "OpenGL-IL",
                 "opengl_dl": "OpenGL-DL"}  # fmt: skip


def paper_row(task: str, mode: str, n_classes: int = _PAPER_CLASSES) -> PaperRow | None:
    """The paper's row for a lighting mode without fine-tuning; where it has none, MLT's best.

    None where the paper says nothing: of depth, and of other classes than NYU40.
    """
    if task not in PAPER or n_classes != _PAPER_CLASSES:
        return None
    name = _NAMES.get(mode, "MLT-IL/OL")
    rows = PAPER[task]
    same = [row for row in rows if row.pretrained == name and not row.tuned]
    return same[0] if same else rows[-1]


def tuned_row(task: str, pretrained: str) -> PaperRow:
    """The paper's row tuned on NYUv2 from a lighting mode; without one, trained on NYUv2 alone."""
    name = _NAMES.get(pretrained)
    rows = PAPER[task]
    tuned = [row for row in rows if row.tuned and name is not None]
    # Segmentation tells MLT from OpenGL, the other tasks their lights too.
    same = [row for row in tuned if row.pretrained == name]
    kind = "MLT" if name and name.startswith("MLT") else "OpenGL"
    return next(iter(same or [row for row in tuned if kind in row.pretrained]), rows[0])


# Views to judge on whose truth has a size of its own, as of photographs.


@dataclass(frozen=True, slots=True, eq=False)
class JudgedViews:
    """Pictures at the network's size, and what is true of each."""

    name: str  # what a table calls them
    truth: str  # which truth and which mask, in words
    ids: tuple[str, ...]
    colour: NDArray[np.uint8]  # (N, h, w, 3) sRGB
    truths: tuple[Arrays, ...]  # arrays (H, W, ...) of each view, of any size
    credits: tuple[str, ...] = ()  # whose homes the pictures show

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """(height, width) of each truth."""
        shapes = [next(iter(truth.values())).shape for truth in self.truths]
        return [(int(shape[0]), int(shape[1])) for shape in shapes]


def judged_of_arrays(
    name: str, truth: str, views: ViewArrays, credits: tuple[str, ...] = ()
) -> JudgedViews:
    """Rendered views, whose truth has the network's size."""
    truths = tuple(views.target(k) for k in range(len(views)))
    return JudgedViews(name, truth, views.ids, views.colour, truths, credits)


# A finished run judged on views.


_HED_ROW = "HED untouched"
_LEAST_GROUPS = 3


@dataclass(frozen=True, slots=True)
class Trained:
    """A finished run, its network loaded."""

    folder: RunFolder
    record: dict[str, Any]
    plan: TrainingPlan
    task: StudyTask
    network: nn.Module
    baseline: F32

    @property
    def figures(self) -> dict[str, Any]:
        """What training said at its end: on its own views and on held-out homes."""
        return self.folder.figures()


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What was judged on what."""

    views: JudgedViews
    rows: dict[str, Judged]  # "network", the baseline's name, HED untouched

    @property
    def groups(self) -> dict[str, float]:
        """Mean error of the network by what the views' ids begin with: a home, a folder of photographs."""
        by_group: dict[str, list[float]] = {}
        for view, error in zip(self.views.ids, self.rows["network"].errors, strict=True):
            if math.isfinite(error):
                by_group.setdefault(view.rpartition("/")[0], []).append(error)
        return {group: statistics.fmean(errors) for group, errors in sorted(by_group.items())}

    def as_json(self) -> dict[str, Any]:
        """Figures, each group's mean error, and each view's own."""
        return {
            "on": self.views.name,
            "truth": self.views.truth,
            "n_views": len(self.views.ids),
            "figures": {name: judged.figures for name, judged in self.rows.items()},
            "groups": self.groups,
            "errors": dict(zip(self.views.ids, self.rows["network"].errors, strict=True)),
        }


def mean_interval(values: Sequence[float], *, level: float = 0.9) -> tuple[float, float]:
    """The bootstrap's interval of a mean: of values drawn anew, 4,000 times, with a seed of its own.

    Views of one room are alike, so that an interval over views would be far too narrow: draw rooms.

    Example:
        >>> mean_interval([30.0, 30.0, 30.0])
        (30.0, 30.0)
    """
    draws = np.random.default_rng(0).choice(np.asarray(values, np.float64), (4_000, len(values)))
    low, high = np.quantile(draws.mean(axis=1), [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def open_run(root: Path, *, exact: bool = False) -> Trained:
    """Load a finished run; BadInput for any other folder.

    exact: boundaries are judged at the benchmark's own 99 thresholds.
    """
    folder, record, plan = finished_run(root)
    check_exact(plan.task, exact=exact)
    task = task_of(plan.task, EXACT_THRESHOLDS if exact else 0)
    network = network_of(plan.network, task.n_out(plan))
    _check_sha256(folder.weights, str(record.get("weights_sha256", "")))
    position = load_checkpoint(folder.weights, network)
    if position.task != plan.task:
        raise BadInput(folder.weights, "", f"weights of task {position.task}, not {plan.task}")
    try:
        baseline = np.asarray(np.load(folder.baseline, allow_pickle=False), np.float32)
    except (OSError, ValueError):
        raise BadInput(folder.baseline, "", "missing or damaged: train again") from None
    return Trained(folder, record, plan, task, placed(network, plan), baseline)


def _check_sha256(path: Path, told: str) -> None:
    """Raise BadInput where packed weights are not those their record names."""
    if told and path.exists() and hashlib.sha256(path.read_bytes()).hexdigest() != told:
        raise BadInput(path, "", "other bytes than run.json's weights_sha256: damaged or changed")


def check_exact(task_name: str, *, exact: bool) -> None:
    """Raise BadInput where 99 thresholds are asked for of a task that has none."""
    if exact and task_name != "boundaries":
        raise BadInput("--exact", "", f"{task_name} has no thresholds: of boundaries alone")


def predictions_of(run: Trained, views: JudgedViews) -> Iterator[NDArray[Any]]:
    """A prediction of each view, of the size of its truth."""
    return predicted(run.network, views.colour, run.task, run.plan, views.sizes)


def evaluate(run: Trained, views: JudgedViews) -> Evaluation:
    """Judge the network and what needs no training."""
    rows = {"network": _judged(predictions_of(run, views), run, views)}
    still = (resized_nearest(run.baseline, width, height) for height, width in views.sizes)
    rows[run.figures["baseline_name"]] = _judged(still, run, views)
    if run.task.name == "boundaries" and has_hed():
        rows[_HED_ROW] = _judged(_untouched_hed(run, views), run, views)
    return Evaluation(views, rows)


def with_others(
    run: Trained, evaluation: Evaluation, name: str, predictions: Iterable[NDArray[Any]]
) -> Evaluation:
    """The evaluation with a column more: what another program says of the same views."""
    if name in evaluation.rows:
        raise BadInput("--predictions", name, "a second column of this name", hint="NAME=DIR")
    judged = _judged(predictions, run, evaluation.views)
    return Evaluation(evaluation.views, evaluation.rows | {name: judged})


def _judged(predictions: Iterable[NDArray[Any]], run: Trained, views: JudgedViews) -> Judged:
    return scored(predictions, views.truths, run.task, run.plan)


def _untouched_hed(run: Trained, views: JudgedViews) -> Iterator[NDArray[Any]]:
    """What HED says that has seen BSDS500 alone; it knows pictures of 320 pixels and more."""
    enlarge = str(max(1, round(320 / run.plan.width_px)))
    fields = {"network": "hed", "enlarge": enlarge, "device": run.plan.device}
    plan = plan_of("boundaries", "tiny", fields)
    network = network_of("hed", 1)
    start_from(network, "hed")
    return predicted(placed(network, plan), views.colour, run.task, plan, views.sizes)


def table(run: Trained, evaluations: list[Evaluation]) -> str:
    """Figures by row; training homes, held-out homes and what was judged, side by side, as Markdown."""
    paper = _paper(run)
    columns: list[tuple[str, dict[str, float]]] = []
    stored = run.figures
    for part, title in (("train", "training homes"), ("held_out", "held-out homes")):
        if part in stored["network"]:
            n = stored.get("views", run.record["views"])[part]
            columns.append((f"{title} ({n})", stored["network"][part]))
            columns.append((stored["baseline_name"], stored["baseline"][part]))
    for one in evaluations:
        n = len(one.views.ids)
        for name, judged in one.rows.items():
            columns.append(
                (f"{one.views.name} ({n})" if name == "network" else name, judged.figures)
            )
    rows = []
    for k, figure in enumerate(run.task.figures):
        cells = [shown_figure(figure, figures[figure]) for _, figures in columns]
        known = shown_figure(figure, paper.figures[k]) if paper and k < len(paper.figures) else "-"
        rows.append([title_of(figure), *cells, *([known] if paper else [])])
    titles = ["", *(title for title, _ in columns)]
    if paper:
        tuned = f", then {paper.tuned}" if paper.tuned else ""
        titles.append(f"paper: {paper.pretrained}{tuned}, on NYUv2")
    return markdown(titles, rows)


def _paper(run: Trained) -> PaperRow | None:
    """The paper's row beside this run: of its light, or of the light it was tuned from."""
    mode = str(run.record["mode"])
    row = paper_row(run.task.name, mode, run.plan.n_classes)
    if row is None or mode != NYU_LIGHT:
        return row
    return tuned_row(run.task.name, str(run.record["init_origin"].get("mode", "")))


def notes(run: Trained, evaluations: list[Evaluation]) -> list[str]:
    """What must be said with the table: underfit, and which truth and mask."""
    said = []
    stored = run.figures
    train, still = (run.task.error(stored[name]["train"]) for name in ("network", "baseline"))
    if is_underfit(train, still):
        said.append(
            f"underfit: the error on its own training views, {train:.3g}, is above 80 % of the"
            f" baseline's, {still:.3g}; rank nothing by it"
        )
    if seconds := run.record.get("seconds_a_step"):
        taken = min(seconds, key=lambda name: float(seconds[name]))
        timed = ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items())
        said.append(f"a step takes {timed} here: trained in {taken}")
    said.append(f"truth of training and held-out homes: {run.record['truth']}")
    if isinstance(run.task, EdgesTask):
        text = f"thresholds: {N_THRESHOLDS} of training and held-out homes"
        said.append(text + f", {run.task.n_thresholds} of all else" * bool(evaluations))
    for one in evaluations:
        said.append(f"truth of {one.views.name}: {one.views.truth}")
        said += _said_of_groups(run.task, one)
    if _paper(run):
        said.append("the paper's numbers are of other pictures, another truth and 568,793 views")
    return said


def _said_of_groups(task: StudyTask, evaluation: Evaluation) -> list[str]:
    """The mean over homes or folders with its interval, where there are enough to tell one."""
    groups = list(evaluation.groups.values())
    if len(groups) < _LEAST_GROUPS:
        return []
    scale, unit = (1, " degrees") if task.name == "normals" else (100, " %")
    mean, low, high = (scale * x for x in (statistics.fmean(groups), *mean_interval(groups)))
    what = f"{evaluation.views.name}, over its {len(groups)} homes or folders"
    return [
        f"{what}: {task.error_name}, mean {mean:.1f}{unit}, 90 % within {low:.1f} to {high:.1f}"
    ]


def report(run: Trained, evaluations: list[Evaluation]) -> dict[str, Any]:
    """Everything of the table and more, as JSON."""
    paper = _paper(run)
    return {
        "run": run.record,
        "trained": run.figures,
        "evaluations": [one.as_json() for one in evaluations],
        "paper": asdict(paper) if paper else None,
        "notes": notes(run, evaluations),
    }
