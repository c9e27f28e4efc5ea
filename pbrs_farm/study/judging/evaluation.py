"""A finished run judged on views: figures beside the baseline, HED untouched and the paper. Effects: reads the run."""

from __future__ import annotations

import hashlib
import math
import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.study.judging.figure_text import is_underfit, markdown, shown_figure, title_of
from pbrs_farm.study.judging.paper_figures import PaperRow, paper_row, tuned_row
from pbrs_farm.study.metrics.edge_scores import EXACT_THRESHOLDS
from pbrs_farm.study.metrics.error_parts import PARTS, ErrorParts
from pbrs_farm.study.networks.initial_weights import has_hed, start_from
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.tasks.edges_task import N_THRESHOLDS, EdgesTask
from pbrs_farm.study.tasks.study_task import Arrays, StudyTask
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.checkpoint import load_checkpoint
from pbrs_farm.study.training.prediction import Judged, move_to_device, predict, score_predictions
from pbrs_farm.study.training.run_folder import RunFolder, finished_run
from pbrs_farm.study.training.training_views import ViewArrays
from pbrs_farm.study.training.view_sources import NYU_LIGHT
from pbrs_farm.study.training_plan import TrainingPlan, plan_of

_HED_ROW = "HED untouched"
_LEAST_GROUPS = 3


@dataclass(frozen=True, slots=True, eq=False)
class JudgedViews:
    """Pictures at the network's size, and what is true of each."""

    name: str  # what a table calls them
    truth: str  # which truth and which mask, in words
    ids: tuple[str, ...]
    colour: NDArray[np.uint8]  # (N, h, w, 3) sRGB
    truths: tuple[Arrays, ...]  # arrays (H, W, ...) of each view, of any size
    credits: tuple[str, ...] = ()  # whose homes the pictures show
    cameras: F32 | None = None  # (N, 4) fx, fy, cx, cy of each picture, of plans with `rays`

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """(height, width) of each truth.

        Truths of one set may differ in size, as photographs do: predictions are asked for at these.
        """
        shapes = [next(iter(truth.values())).shape for truth in self.truths]
        return [(int(shape[0]), int(shape[1])) for shape in shapes]


def judged_of_arrays(
    name: str, truth: str, views: ViewArrays, credits: tuple[str, ...] = ()
) -> JudgedViews:
    """Rendered views, whose truth has the network's size."""
    truths = tuple(views.target(k) for k in range(len(views)))
    return JudgedViews(name, truth, views.ids, views.colour, truths, credits, views.cameras)


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
    parts: dict[str, ErrorParts] = field(default_factory=dict)  # of normals, by the same names

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
            "parts": {name: parts.means_deg() for name, parts in self.parts.items()},
            "shares": next(iter(self.parts.values())).shares() if self.parts else {},
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
    network = network_of(plan.network, task.n_out(plan), rays=plan.rays)
    _check_sha256(folder.weights, str(record.get("weights_sha256", "")))
    position = load_checkpoint(folder.weights, network)
    if position.task != plan.task:
        raise BadInput(folder.weights, "", f"weights of task {position.task}, not {plan.task}")
    try:
        baseline = np.asarray(np.load(folder.baseline, allow_pickle=False), np.float32)
    except (OSError, ValueError):
        raise BadInput(folder.baseline, "", "missing or damaged: train again") from None
    return Trained(folder, record, plan, task, move_to_device(network, plan), baseline)


def _check_sha256(path: Path, expected: str) -> None:
    """Raise BadInput where packed weights are not those their record names."""
    if expected and path.exists() and hashlib.sha256(path.read_bytes()).hexdigest() != expected:
        raise BadInput(path, "", "other bytes than run.json's weights_sha256: damaged or changed")


def check_exact(task_name: str, *, exact: bool) -> None:
    """Raise BadInput where 99 thresholds are asked for of a task that has none."""
    if exact and task_name != "boundaries":
        raise BadInput("--exact", "", f"{task_name} has no thresholds: of boundaries alone")


def predictions_of(run: Trained, views: JudgedViews) -> Iterator[NDArray[Any]]:
    """A prediction of each view, of the size of its truth.

    Lazy, in the order of the views; the network's picture is scaled to the truth's size, not the
    truth to the network's.
    """
    return predict(run.network, views.colour, run.task, run.plan, views.sizes, views.cameras)


def evaluate(run: Trained, views: JudgedViews) -> Evaluation:
    """Judge the network and what needs no training on the same views.

    Beside the network stand the baseline (what the training views are on average) and, for
    boundaries where its weights are installed, HED untouched. Figures are those of task.figures.
    """
    still = (resized_nearest(run.baseline, width, height) for height, width in views.sizes)
    said = {"network": predictions_of(run, views), run.figures["baseline_name"]: still}
    if run.task.name == "boundaries" and has_hed():
        said[_HED_ROW] = _untouched_hed(run, views)
    evaluation = Evaluation(views, {})
    for name, predictions in said.items():
        evaluation = _with_row(run, evaluation, name, predictions)
    return evaluation


def with_others(
    run: Trained, evaluation: Evaluation, name: str, predictions: Iterable[NDArray[Any]]
) -> Evaluation:
    """The evaluation with a column more: what another program says of the same views.

    predictions must be in the order of the views and of their truths' size. BadInput for a name
    that the evaluation has already.
    """
    if name in evaluation.rows:
        raise BadInput("--predictions", name, "a second column of this name", hint="NAME=DIR")
    return _with_row(run, evaluation, name, predictions)


def _with_row(
    run: Trained, evaluation: Evaluation, name: str, predictions: Iterable[NDArray[Any]]
) -> Evaluation:
    views, parts = evaluation.views, dict(evaluation.parts)
    if run.task.name == "normals":
        parts[name] = ErrorParts()
        predictions = _counted(predictions, views, parts[name])
    judged = score_predictions(predictions, views.truths, run.task, run.plan)
    return Evaluation(views, evaluation.rows | {name: judged}, parts)


def _counted(
    predictions: Iterable[NDArray[Any]], views: JudgedViews, parts: ErrorParts
) -> Iterator[NDArray[Any]]:
    """The same predictions; each is counted as it passes."""
    for prediction, truth, colour in zip(predictions, views.truths, views.colour, strict=True):
        parts.add(prediction, truth, colour)
        yield prediction


def _untouched_hed(run: Trained, views: JudgedViews) -> Iterator[NDArray[Any]]:
    """What HED says that has seen BSDS500 alone; it knows pictures of 320 pixels and more."""
    enlarge = str(max(1, round(320 / run.plan.width_px)))
    fields = {"network": "hed", "enlarge": enlarge, "device": run.plan.device}
    plan = plan_of("boundaries", "tiny", fields)
    network = network_of("hed", 1)
    start_from(network, "hed")
    return predict(move_to_device(network, plan), views.colour, run.task, plan, views.sizes)


def figures_table(run: Trained, evaluations: list[Evaluation]) -> str:
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


def parts_tables(evaluations: list[Evaluation]) -> str:
    """Mean angle by kind of surface, depth and luma, a table each that was judged; "" of other tasks."""
    tables = []
    for one in evaluations:
        means = {name: parts.means_deg() for name, parts in one.parts.items()}
        if not means:
            continue
        shares = next(iter(one.parts.values())).shares()
        rows = [
            [part, f"{100 * shares[part]:.1f} %", *(shown_figure("mean_deg", row[part]) for row in means.values())]
            for part in PARTS
            if all(part in row for row in means.values())
        ]  # fmt: skip
        titles = [f"{one.views.name}: mean, degrees", "pixels", *means]
        tables.append(markdown(titles, rows))
    return "\n\n".join(tables)


def _paper(run: Trained) -> PaperRow | None:
    """The paper's row beside this run: of its light, or of the light it was tuned from."""
    mode = str(run.record["mode"])
    row = paper_row(run.task.name, mode, run.plan.n_classes)
    if row is None or mode != NYU_LIGHT:
        return row
    return tuned_row(run.task.name, str(run.record["init_origin"].get("mode", "")))


def notes(run: Trained, evaluations: list[Evaluation]) -> list[str]:
    """What must be said with the table, a line each.

    Underfit networks, timing of both arithmetics, which truth and mask were used, thresholds, means
    over homes with their interval, and that the paper's numbers are of other pictures.
    """
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
    scale, unit = task.error_scale, task.error_unit
    mean, low, high = (scale * x for x in (statistics.fmean(groups), *mean_interval(groups)))
    what = f"{evaluation.views.name}, over its {len(groups)} homes or folders"
    return [
        f"{what}: {task.error_name}, mean {mean:.1f}{unit}, 90 % within {low:.1f} to {high:.1f}"
    ]


def evaluation_text(run: Trained, evaluations: list[Evaluation]) -> str:
    """The table of figures, of normals those by part, and the notes, as Markdown."""
    parts = parts_tables(evaluations)
    tables = [figures_table(run, evaluations), "", *([parts, ""] if parts else [])]
    return "\n".join([*tables, *notes(run, evaluations)])


def report(run: Trained, evaluations: list[Evaluation]) -> dict[str, Any]:
    """Everything of the table and more, as JSON values: evaluation.json.

    run, trained (figures at the end of training), evaluations (figures, of normals the parts, groups
    and every view's error), the paper's row and the notes. What no pixel tells is None.
    """
    paper = _paper(run)
    row = {
        "run": run.record,
        "trained": run.figures,
        "evaluations": [one.as_json() for one in evaluations],
        "paper": asdict(paper) if paper else None,
        "notes": notes(run, evaluations),
    }
    return {key: _without_nan(value) for key, value in row.items()}


def _without_nan(value: Any) -> Any:
    """The value with None for what is not finite: JSON has no word for it."""
    if isinstance(value, dict):
        return {key: _without_nan(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
