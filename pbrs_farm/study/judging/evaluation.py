"""A finished run judged on views: figures beside the baseline, HED untouched and the paper. Effects: reads the run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_nearest
from pbrs_farm.study.judging.figure_table import is_underfit, markdown, shown_figure, title_of
from pbrs_farm.study.judging.paper_numbers import PaperRow, paper_row, tuned_row
from pbrs_farm.study.judging.photo_views import JudgedViews
from pbrs_farm.study.metrics.edge_scores import EXACT_THRESHOLDS
from pbrs_farm.study.networks.initial_weights import has_hed, start_from
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.tasks.edges_task import N_THRESHOLDS, EdgesTask
from pbrs_farm.study.tasks.study_task import Task
from pbrs_farm.study.tasks.task_choice import task_of
from pbrs_farm.study.training.checkpoint import load_checkpoint
from pbrs_farm.study.training.prediction import Judged, placed, predicted, scored
from pbrs_farm.study.training.run_folder import RunFolder, finished_run
from pbrs_farm.study.training.view_sources import NYU_LIGHT
from pbrs_farm.study.training_plan import Plan, plan_of

_HED_ROW = "HED untouched"


@dataclass(frozen=True, slots=True)
class Trained:
    """A finished run, its network loaded."""

    folder: RunFolder
    record: dict[str, Any]
    plan: Plan
    task: Task
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

    def as_json(self) -> dict[str, Any]:
        """Figures, and each view's own error."""
        return {
            "on": self.views.name,
            "truth": self.views.truth,
            "n_views": len(self.views.ids),
            "figures": {name: judged.figures for name, judged in self.rows.items()},
            "errors": dict(zip(self.views.ids, self.rows["network"].errors, strict=True)),
        }


def open_run(root: Path, *, exact: bool = False) -> Trained:
    """Load a finished run; BadInput for any other folder.

    exact: boundaries are judged at the benchmark's own 99 thresholds.
    """
    folder, record, plan = finished_run(root)
    check_exact(plan.task, exact=exact)
    task = task_of(plan.task, EXACT_THRESHOLDS if exact else 0)
    network = network_of(plan.network, task.n_out(plan))
    position = load_checkpoint(folder.weights, network)
    if position.task != plan.task:
        raise BadInput(folder.weights, "", f"weights of task {position.task}, not {plan.task}")
    try:
        baseline = np.asarray(np.load(folder.baseline, allow_pickle=False), np.float32)
    except (OSError, ValueError):
        raise BadInput(folder.baseline, "", "missing or damaged: train again") from None
    return Trained(folder, record, plan, task, placed(network, plan), baseline)


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
        known = shown_figure(figure, paper.figures[k]) if k < len(paper.figures) else "-"
        rows.append([title_of(figure), *cells, known])
    tuned = f", then {paper.tuned}" if paper.tuned else ""
    said = f"paper: {paper.pretrained}{tuned}, on NYUv2"
    return markdown(["", *(title for title, _ in columns), said], rows)


def _paper(run: Trained) -> PaperRow:
    """The paper's row beside this run: of its light, or of the light it was tuned from."""
    mode = str(run.record["mode"])
    if mode != NYU_LIGHT:
        return paper_row(run.task.name, mode)
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
    said.append(f"truth of training and held-out homes: {run.record['truth']}")
    if isinstance(run.task, EdgesTask):
        text = f"thresholds: {N_THRESHOLDS} of training and held-out homes"
        said.append(text + f", {run.task.n_thresholds} of all else" * bool(evaluations))
    said += [f"truth of {one.views.name}: {one.views.truth}" for one in evaluations]
    said.append("the paper's numbers are of other pictures, another truth and 568,793 views")
    return said


def report(run: Trained, evaluations: list[Evaluation]) -> dict[str, Any]:
    """Everything of the table and more, as JSON."""
    return {
        "run": run.record,
        "trained": run.figures,
        "evaluations": [one.as_json() for one in evaluations],
        "paper": asdict(_paper(run)),
        "notes": notes(run, evaluations),
    }
