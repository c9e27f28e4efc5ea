"""Figures of a finished run on test views, beside the baseline, HED and the paper. Effects: reads the run."""

from __future__ import annotations

import hashlib
import math
import statistics
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from torch import nn

import pbrs_farm
from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.progress import seconds_text
from pbrs_farm.study.judging.figure_text import (
    PLANES,
    is_underfit,
    markdown,
    shown_figure,
    title_of,
)
from pbrs_farm.study.judging.paper_figures import PaperRow, paper_row, tuned_row
from pbrs_farm.study.metrics.edge_scores import EXACT_THRESHOLDS
from pbrs_farm.study.metrics.error_parts import PARTS, ErrorParts
from pbrs_farm.study.networks.initial_weights import has_hed, start_from
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.plane_normals import smoothed_normals
from pbrs_farm.study.tasks.edges_task import N_THRESHOLDS, EdgesTask
from pbrs_farm.study.tasks.study_task import Arrays, StudyTask
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.checkpoint import load_checkpoint
from pbrs_farm.study.training.prediction import Judged, move_to_device, predict
from pbrs_farm.study.training.run_folder import RunFolder, finished_run
from pbrs_farm.study.training.training_views import ViewArrays
from pbrs_farm.study.training.view_sources import NYU_LIGHT
from pbrs_farm.study.training_plan import TrainingPlan, plan_of

_HED_ROW = "HED untouched"
FLOOR: Final = "floor of the truth"
"""Row of the smoothed truth judged as a prediction."""
FLOOR_BY_PLANES: Final = "floor by planes"
"""Row of the second estimate of the floor: the truth judged by large planes."""
LARGE_PLANES: Final = ", large planes"
"""End of the names of rows judged by the normals of large planes."""
_LEAST_GROUPS = 3  # minimum number of homes for an interval


@dataclass(frozen=True, slots=True, eq=False)
class JudgedViews:
    """Test pictures at the network's size with their truth."""

    name: str
    truth: str  # description of the truth and its mask
    ids: tuple[str, ...]
    colour: NDArray[np.uint8]  # (N, h, w, 3) sRGB
    truths: tuple[Arrays, ...]  # targets (H, W, ...) of each view at any size
    credits: tuple[str, ...] = ()  # of the homes in the pictures
    cameras: F32 | None = None  # (N, 4) fx, fy, cx, cy of each picture, of plans with `rays`
    rooms: tuple[str, ...] = ()  # room of each photograph

    @property
    def sizes(self) -> list[tuple[int, int]]:
        """(height, width) of each truth; photographs differ in size."""
        shapes = [next(iter(truth.values())).shape for truth in self.truths]
        return [(int(shape[0]), int(shape[1])) for shape in shapes]

    @property
    def plane_truths(self) -> tuple[Arrays, ...]:
        """The truths with the normals of large planes, of photographs."""
        if "plane" not in self.truths[0]:
            return ()
        return tuple(
            truth | {"normal": truth["plane"], "valid": np.asarray(truth["plane"].any(-1))}
            for truth in self.truths
        )


def judged_of_arrays(
    name: str, truth: str, views: ViewArrays, credits: tuple[str, ...] = ()
) -> JudgedViews:
    """Rendered views, with truth at the network's size."""
    truths = tuple(views.all_targets())
    return JudgedViews(name, truth, views.ids, views.colour, truths, credits, views.cameras)


@dataclass(frozen=True, slots=True)
class Trained:
    """A finished run with its network."""

    folder: RunFolder
    record: dict[str, Any]
    plan: TrainingPlan
    task: StudyTask
    network: nn.Module
    baseline: F32

    @property
    def figures(self) -> dict[str, Any]:
        """Figures at the end of training, on training views and held-out homes."""
        return self.folder.figures()


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Figures of predictions for a set of test views."""

    views: JudgedViews
    rows: dict[str, Judged]  # "network", the baseline's name, HED untouched, FLOOR, FLOOR_BY_PLANES
    parts: dict[str, ErrorParts] = field(default_factory=dict)  # of normals, by the names of rows
    mirror: bool = False  # the network's predictions are means with those of mirrored pictures

    @property
    def groups(self) -> dict[str, float]:
        """Mean error of the network by home, or by room of photographs."""
        return self.groups_of("network")

    def groups_of(self, name: str) -> dict[str, float]:
        """Mean error of a row by home, or by room of photographs."""
        by_group: dict[str, list[float]] = {}
        groups = self.views.rooms or [view.rpartition("/")[0] for view in self.views.ids]
        for group, error in zip(groups, self.rows[name].errors, strict=True):
            if math.isfinite(error):
                by_group.setdefault(group, []).append(error)
        return {group: statistics.fmean(errors) for group, errors in sorted(by_group.items())}

    def over_rooms(self, name: str) -> float:
        """Mean of a row over homes or rooms; NaN without truth."""
        return statistics.fmean(self.groups_of(name).values() or [math.nan])

    def share_of_pixels(self, name: str) -> float | None:
        """Share of the pixels that a row counts; None for tasks without a mask."""
        n = self.rows[name].figures.get("n_pixels") if name in self.rows else None
        return None if n is None else n / sum(height * width for height, width in self.views.sizes)

    def shares_of(self, name: str) -> dict[str, float]:
        """Share of the pixels that a row counts in each part of normals; {} for other tasks."""
        return self.parts[name].shares() if name in self.parts else {}

    def as_json(self) -> dict[str, Any]:
        """Figures, each group's mean error, and each view's own."""
        return {
            "on": self.views.name,
            "truth": self.views.truth,
            "n_views": len(self.views.ids),
            "mirror": self.mirror,
            "measured": self.share_of_pixels("network"),
            "on_large_planes": self.share_of_pixels("network" + LARGE_PLANES),
            "figures": {name: judged.figures for name, judged in self.rows.items()},
            "over_rooms": {name: self.over_rooms(name) for name in self.rows},
            "parts": {name: parts.means_deg() for name, parts in self.parts.items()},
            "shares": self.shares_of("network"),
            "plane_shares": self.shares_of("network" + LARGE_PLANES),
            "groups": self.groups,
            "errors": dict(zip(self.views.ids, self.rows["network"].errors, strict=True)),
        }


def mean_interval(values: Sequence[float], *, level: float = 0.9) -> tuple[float, float]:
    """Bootstrap interval of a mean, from 4,000 resamples with a fixed seed.

    Views of one room are alike, so an interval over views would be too narrow: pass means of rooms.

    Example:
        >>> mean_interval([30.0, 30.0, 30.0])
        (30.0, 30.0)
    """
    draws = np.random.default_rng(0).choice(np.asarray(values, np.float64), (4_000, len(values)))
    low, high = np.quantile(draws.mean(axis=1), [(1 - level) / 2, (1 + level) / 2])
    return float(low), float(high)


def open_run(root: Path, *, exact: bool = False) -> Trained:
    """Load a finished run; BadInput for any other folder. exact: boundaries at 99 thresholds."""
    folder, record, plan = finished_run(root)
    check_exact(plan.task, exact=exact)
    task = task_of(plan.task, EXACT_THRESHOLDS if exact else N_THRESHOLDS)
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
    """Raise BadInput if packed weights differ from their record."""
    if expected and path.exists() and hashlib.sha256(path.read_bytes()).hexdigest() != expected:
        raise BadInput(path, "", "other bytes than run.json's weights_sha256: damaged or changed")


def check_exact(task_name: str, *, exact: bool) -> None:
    """Raise BadInput for --exact with a task without thresholds."""
    if exact and task_name != "boundaries":
        raise BadInput("--exact", "", f"{task_name} has no thresholds: of boundaries alone")


def predictions_of(
    run: Trained, views: JudgedViews, *, mirror: bool = False
) -> Iterator[NDArray[Any]]:
    """A prediction of each view in order, at the size of its truth."""
    network, task, plan = run.network, run.task, run.plan
    return predict(network, views.colour, task, plan, views.sizes, views.cameras, mirror=mirror)


def evaluate(run: Trained, views: JudgedViews, *, mirror: bool = False) -> Evaluation:
    """Score the network, the baseline, the truth of photographs, and HED if its weights are installed.

    mirror: average the network's predictions with those of the mirrored pictures.
    """
    constant = (resized_nearest(run.baseline, width, height) for height, width in views.sizes)
    rows = {
        "network": predictions_of(run, views, mirror=mirror),
        run.figures["baseline_name"]: constant,
    }
    if run.task.name == "boundaries" and has_hed():
        rows[_HED_ROW] = _untouched_hed(run, views)
    evaluation = Evaluation(views, {}, mirror=mirror)
    for name, predictions in rows.items():
        evaluation = _with_row(run, evaluation, name, predictions)
    if planes := views.plane_truths:
        smooth = (smoothed_normals(truth["normal"], truth["valid"]) for truth in views.truths)
        evaluation = _judged_by(run, evaluation, smooth, {FLOOR: views.truths})
        measured = (truth["normal"] for truth in views.truths)
        evaluation = _judged_by(run, evaluation, measured, {FLOOR_BY_PLANES: planes})
    return evaluation


def with_others(
    run: Trained, evaluation: Evaluation, name: str, predictions: Iterable[NDArray[Any]]
) -> Evaluation:
    """The evaluation with a column of predictions in the order of the truths; BadInput for a repeated name."""
    if name in evaluation.rows:
        raise BadInput("--predictions", name, "a second column of this name", hint="NAME=DIR")
    return _with_row(run, evaluation, name, predictions)


def _with_row(
    run: Trained, evaluation: Evaluation, name: str, predictions: Iterable[NDArray[Any]]
) -> Evaluation:
    views = evaluation.views
    planes = {name + LARGE_PLANES: views.plane_truths} if views.plane_truths else {}
    return _judged_by(run, evaluation, predictions, {name: views.truths, **planes})


def _judged_by(
    run: Trained,
    evaluation: Evaluation,
    predictions: Iterable[NDArray[Any]],
    truths: dict[str, tuple[Arrays, ...]],
) -> Evaluation:
    """The evaluation with a row of the same predictions by each of the truths, by name."""
    scorers = {name: run.task.scorer(run.plan) for name in truths}
    errors: dict[str, list[float]] = {name: [] for name in truths}
    parts = {name: ErrorParts() for name in truths if run.task.name == "normals"}
    for k, (prediction, colour) in enumerate(
        zip(predictions, evaluation.views.colour, strict=True)
    ):
        for name, rows in truths.items():
            errors[name].append(scorers[name].add(prediction, rows[k]))
            if name in parts:
                parts[name].add(prediction, rows[k], colour)
    judged = {name: Judged(scorers[name].figures(), tuple(errors[name])) for name in truths}
    return replace(evaluation, rows=evaluation.rows | judged, parts=evaluation.parts | parts)


def _untouched_hed(run: Trained, views: JudgedViews) -> Iterator[NDArray[Any]]:
    """Predictions of HED as trained on BSDS500, whose pictures have 320 pixels or more."""
    enlarge = str(max(1, round(320 / run.plan.width_px)))
    fields = {"network": "hed", "enlarge": enlarge, "device": run.plan.device}
    plan = plan_of("boundaries", "tiny", fields)
    network = network_of("hed", 1)
    start_from(network, "hed")
    return predict(move_to_device(network, plan), views.colour, run.task, plan, views.sizes)


def figures_table(run: Trained, evaluations: list[Evaluation]) -> str:
    """Figures of training homes, held-out homes and test sets side by side, as Markdown."""
    paper, task = _paper(run), run.task
    columns: list[tuple[str, dict[str, float]]] = []
    for title, network, baseline in trained_columns(run):
        columns += [(title, network), (run.figures["baseline_name"], baseline)]
    for evaluation in evaluations:
        first = f"{evaluation.views.name} ({len(evaluation.views.ids)})"
        columns += [
            (first if name == "network" else name, figures_of_row(task, evaluation, name))
            for name in evaluation.rows
            if not name.endswith(LARGE_PLANES)
        ]
    if paper:
        tuned = f", then {paper.tuned}" if paper.tuned else ""
        published = dict(zip(task.figures, paper.figures, strict=False))
        columns.append((f"paper: {paper.pretrained}{tuned}, on NYUv2", published))
    names = (*task.figures, over_rooms_of(task), *(PLANES + name for name in task.figures))
    rows = [
        [title_of(name), *(shown_figure(name, figures.get(name)) for _, figures in columns)]
        for name in names
        if any(name in figures for _, figures in columns)
    ]
    return markdown(["", *(title for title, _ in columns)], rows)


def over_rooms_of(task: StudyTask) -> str:
    """Name of the figure of the mean error over homes or rooms."""
    return "over_rooms_deg" if task.name == "normals" else "over_rooms"


def figures_of_row(task: StudyTask, evaluation: Evaluation, name: str) -> dict[str, float]:
    """Figures of a row, its mean over rooms, and those by large planes."""
    figures = evaluation.rows[name].figures | {over_rooms_of(task): evaluation.over_rooms(name)}
    planes = evaluation.rows.get(name + LARGE_PLANES)
    return figures | ({PLANES + k: v for k, v in planes.figures.items()} if planes else {})


def trained_columns(run: Trained) -> list[tuple[str, dict[str, float], dict[str, float]]]:
    """Title, figures of the network and of the baseline for training and held-out homes."""
    stored, counts = run.figures, run.figures.get("views", run.record["views"])
    titles = {"train": "training homes", "held_out": "held-out homes"}
    return [
        (f"{title} ({counts[part]})", stored["network"][part], stored["baseline"][part])
        for part, title in titles.items()
        if part in stored["network"]
    ]


def parts_tables(evaluations: Iterable[dict[str, Any]]) -> str:
    """Tables of the mean angle by kind of surface, depth and luma of rows of JSON; "" for other tasks."""
    tables = []
    for row in evaluations:
        for end, shares in (("", row["shares"]), (LARGE_PLANES, row.get("plane_shares", {}))):
            # By large planes, other pixels count.
            means = {
                name.removesuffix(LARGE_PLANES): column
                for name, column in row["parts"].items()
                if name.endswith(LARGE_PLANES) == bool(end) and name != FLOOR_BY_PLANES
            }
            rows = [
                [
                    part,
                    f"{100 * shares[part]:.1f} %",
                    *(shown_figure("mean_deg", column.get(part)) for column in means.values()),
                ]
                for part in PARTS
                if any(part in column for column in means.values())
            ]
            if rows:
                head = f"{row['on']}{end}: mean, degrees"
                tables.append(markdown([head, "pixels", *means], rows))
    return "\n\n".join(tables)


def _paper(run: Trained) -> PaperRow | None:
    """The paper's row for the light of this run, or for the light of its first weights."""
    mode = str(run.record["mode"])
    row = paper_row(run.task.name, mode, run.plan.n_classes)
    if row is None or mode != NYU_LIGHT:
        return row
    return tuned_row(run.task.name, str(run.record["init_origin"].get("mode", "")))


def notes(run: Trained, evaluations: list[Evaluation]) -> list[str]:
    """Notes under the table: underfitting, speed, truths, thresholds, intervals, the paper."""
    lines = []
    stored = run.figures
    train, constant = (run.task.error(stored[name]["train"]) for name in ("network", "baseline"))
    if is_underfit(train, constant):
        lines.append(
            f"underfit: the error on its own training views, {train:.3g}, is above 80 % of the"
            f" baseline's, {constant:.3g}; rank nothing by it"
        )
    if took := run.record.get("seconds"):
        lines.append(f"trained in {seconds_text(took)} on {run.record['machine']}")
    if seconds := run.record.get("seconds_a_step"):
        fastest = min(seconds, key=lambda name: float(seconds[name]))
        timed = ", ".join(f"{name} {value:.2f} s" for name, value in seconds.items())
        lines.append(f"a step takes {timed} here: trained in {fastest}")
    lines.append(f"truth of training and held-out homes: {run.record['truth']}")
    if isinstance(run.task, EdgesTask):
        text = f"thresholds: {N_THRESHOLDS} of training and held-out homes"
        lines.append(text + f", {run.task.n_thresholds} of all else" * bool(evaluations))
    for evaluation in evaluations:
        shares = {
            " % of the pixels measured": evaluation.share_of_pixels("network"),
            " % on large planes": evaluation.share_of_pixels("network" + LARGE_PLANES),
        }
        texts = [
            f"; {100 * share:.0f}{what}" for what, share in shares.items() if share is not None
        ]
        lines.append(f"truth of {evaluation.views.name}: {evaluation.views.truth}{''.join(texts)}")
        lines += _interval_of_groups(run.task, evaluation)
    if any(evaluation.mirror for evaluation in evaluations):
        text = "averaged with those of the mirrored pictures; of training and held-out homes they are not"
        lines.append(f"predictions of --on are {text}")
    if any(FLOOR in evaluation.rows for evaluation in evaluations):
        text = "the smoothed truth judged as a prediction"
        lines.append(f"{FLOOR}, about a perfect network's error: {text}")
        text = "the truth judged by large planes, at most 30 degrees from it"
        lines.append(f"{FLOOR_BY_PLANES}, a second estimate: {text}")
        lines.append("by large planes a perfect network errs by about 0 degrees")
    if _paper(run):
        lines.append("the paper's numbers are of other pictures, another truth and 568,793 views")
    return lines


def _interval_of_groups(task: StudyTask, evaluation: Evaluation) -> list[str]:
    """The mean over homes or rooms with its interval, if there are enough."""
    groups = list(evaluation.groups.values())
    if len(groups) < _LEAST_GROUPS:
        return []
    scale, unit = task.error_scale, task.error_unit
    mean, low, high = (scale * x for x in (statistics.fmean(groups), *mean_interval(groups)))
    place = f"{evaluation.views.name}, over its {len(groups)} homes or rooms: {task.error_name}"
    return [f"{place}, mean {mean:.1f}{unit}, 90 % within {low:.1f} to {high:.1f}"]


def evaluation_text(run: Trained, evaluations: list[Evaluation]) -> str:
    """The tables and the notes as Markdown."""
    parts = parts_tables(evaluation.as_json() for evaluation in evaluations)
    tables = [figures_table(run, evaluations), "", *([parts, ""] if parts else [])]
    return "\n".join([*tables, *notes(run, evaluations)])


def report(run: Trained, evaluations: list[Evaluation], command: str = "") -> dict[str, Any]:
    """Content of evaluation.json; None for figures without pixels.

    run, trained (figures at the end of training), evaluations (figures, parts of normals, groups and
    the error of each view), the paper's row, the notes, and the command with its version.
    """
    paper = _paper(run)
    row = {
        "run": run.record,
        "trained": run.figures,
        "evaluations": [evaluation.as_json() for evaluation in evaluations],
        "paper": paper.model_dump(exclude={"task"}, mode="json") if paper else None,
        "notes": notes(run, evaluations),
        "command": command,
        "pbrs_farm": pbrs_farm.__version__,
    }
    return {key: _without_nan(value) for key, value in row.items()}


def _without_nan(value: Any) -> Any:
    """The value with None for NaN and infinities, which JSON lacks."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
