"""The paper's comparison: a network trained on several sets, equal but for the pictures. Effects: files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.judging.evaluation import JudgedViews, evaluate, open_run
from pbrs_farm.study.judging.figure_text import (
    is_underfit,
    markdown,
    shown_figure,
    spread_text,
    title_of,
)
from pbrs_farm.study.judging.paper_figures import paper_row
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.training_job import Job, train
from pbrs_farm.study.training.training_views import TrainingViews, ViewArrays
from pbrs_farm.study.training.view_sources import (
    TrainingSource,
    held_out_views,
    missing_of,
    training_views,
)
from pbrs_farm.study.training_plan import TrainingPlan

Tell = Callable[[str], None]
_ONE_SEED = "one seed: how far others would differ is not known"


@dataclass(frozen=True, slots=True)
class TrainingSet:
    """A row of the comparison."""

    name: str
    source: TrainingSource


@dataclass(frozen=True, slots=True)
class Comparison:
    """The sets and the plan of a comparison. out: folder of all runs; killed runs resume."""

    sets: tuple[TrainingSet, ...]
    plan: TrainingPlan
    out: Path
    n_seeds: int = 3
    equal_views: bool = True
    exact: bool = False  # boundaries at 99 thresholds


def compare(
    comparison: Comparison, judged_on: Sequence[JudgedViews], tell: Tell = lambda _line: None
) -> dict[str, Any]:
    """Train every set with every seed and test on all views; equal_views reduces sets to the smallest's size."""
    plan, rows = comparison.plan, {}
    loaded = [training_views(row.source, plan) for row in comparison.sets]
    if comparison.equal_views:
        fewest = min(len(views) for views in loaded)
        loaded = [views.some(fewest) for views in loaded]
    for row, views in zip(comparison.sets, loaded, strict=True):
        held_out = held_out_views(row.source, plan)
        runs = [
            _trained_row(comparison, row, views, held_out, judged_on, seed)
            for seed in range(comparison.n_seeds)
        ]
        rows[row.name] = {"mode": row.source.modes[0], "views": len(views), "seeds": runs}
        tell(f"{row.name}: {_line(rows[row.name], plan)}")
    return {
        "task": plan.task,
        "plan": plan.name,
        "n_classes": plan.n_classes,
        "steps": plan.steps,
        "judged_on": {
            views.name: {"truth": views.truth, "n_views": len(views.ids)} for views in judged_on
        },
        "rows": rows,
    }


def _trained_row(
    comparison: Comparison,
    row: TrainingSet,
    views: TrainingViews,
    held_out: ViewArrays | None,
    judged_on: Sequence[JudgedViews],
    seed: int,
) -> dict[str, Any]:
    """Figures of one seed of a set on its own views and on the test views."""
    out = comparison.out / row.name / f"seed{seed}"
    job = Job(comparison.plan, out, seed, row.source.modes[0], row.source.name)
    figures = train(job, views, held_out)
    run = open_run(out, exact=comparison.exact)
    columns = {on.name: evaluate(run, on).rows for on in judged_on}
    return figures | {
        "on": {
            name: {column: judged.figures for column, judged in judged_rows.items()}
            for name, judged_rows in columns.items()
        }
    }


def _line(row: dict[str, Any], plan: TrainingPlan) -> str:
    task = task_of(plan.task)
    figure = task.figures[0]
    parts = []
    for part in ("train", "held_out"):
        values = [run["network"][part][figure] for run in row["seeds"] if part in run["network"]]
        if values:
            parts.append(f"{part.replace('_', ' ')} {spread_text(figure, values)}")
    return f"{title_of(figure)}: {', '.join(parts)}"


def ablation_table(result: dict[str, Any]) -> str:
    """Rows by set: views, training and held-out homes, each test set, and the paper."""
    task = task_of(result["task"])
    figure = task.figures[0]
    places = list(result["judged_on"])
    head = ["trained on", "views", "training homes", "held-out homes, own light"]
    head += [f"{name} ({result['judged_on'][name]['n_views']})" for name in places]
    rows, underfit = [], []
    for name, row in result["rows"].items():
        runs = row["seeds"]
        cells = [
            _figure_cell(figure, [run["network"].get(part) for run in runs])
            for part in ("train", "held_out")
        ]
        cells += [_figure_cell(figure, [run["on"][on]["network"] for run in runs]) for on in places]
        paper = paper_row(task.name, row["mode"], result["n_classes"])
        published = paper.figures[0] if paper and not paper.tuned else None
        rows.append([name, str(row["views"]), *cells, shown_figure(figure, published)])
        if any(_is_underfit(task.name, run) for run in runs):
            underfit.append(name)
    rows.append(_baseline_row(result, figure, places))
    text = markdown([*head, "paper, NYUv2"], rows)
    n = len(next(iter(result["rows"].values()))["seeds"])
    spread = f"± is the standard deviation of {n} seeds" if n > 1 else _ONE_SEED
    notes = [f"{title_of(figure)}; {spread}."]
    if underfit:
        notes.append(f"underfit, rank nothing by it: {', '.join(underfit)}.")
    notes += [f"Truth of {name}: {on['truth']}." for name, on in result["judged_on"].items()]
    return text + "\n\n" + "\n".join(notes) + "\n"


def _figure_cell(figure: str, figures: Sequence[dict[str, float] | None]) -> str:
    values = [row[figure] for row in figures if row is not None]
    return spread_text(figure, values) if values else "-"


def _baseline_row(result: dict[str, Any], figure: str, places: Sequence[str]) -> list[str]:
    """The baseline of the first set."""
    row = next(iter(result["rows"].values()))
    run = row["seeds"][0]
    name = run["baseline_name"]
    parts = [_figure_cell(figure, [run["baseline"].get(part)]) for part in ("train", "held_out")]
    parts += [_figure_cell(figure, [run["on"][on][name]]) for on in places]
    return [f"baseline: {name}", "-", *parts, "-"]


def _is_underfit(task_name: str, run: dict[str, Any]) -> bool:
    error = task_of(task_name).error
    return is_underfit(error(run["network"]["train"]), error(run["baseline"]["train"]))


def hold_out_notes(sets: Sequence[TrainingSet]) -> list[str]:
    """Notes on held-out homes that some rows lack; BadInput for a home that all rows lack."""
    missing = {row.name: missing_of(row.source) for row in sets}
    everywhere = set.intersection(*(set(names) for names in missing.values()))
    if everywhere:
        places = ", ".join(dict.fromkeys(row.source.name for row in sets))
        raise BadInput("--hold-out", min(everywhere), f"no such home in {places}")
    return [
        f"{row} has no home {', '.join(names)} to hold out"
        for row, names in missing.items()
        if names
    ]


def training_sets(
    words: Sequence[str], modes: Sequence[str], source: TrainingSource
) -> tuple[TrainingSet, ...]:
    """Rows of `[NAME=]ROOT[+ROOT][@MODE]`, one per mode without its own; BadInput for two of one name."""
    sets: dict[str, TrainingSet] = {}
    for word in words:
        label, equals, rest = word.partition("=")
        label, rest = (label, rest) if equals else ("", word)
        places, _, mode = rest.partition("@")
        if places.endswith(".mat"):
            hint = "`train TASK nyu.mat --init RUN` tunes a run on it"
            raise BadInput("ablation", word, "photographs have no lighting modes", hint=hint)
        for light in (mode,) if mode else tuple(modes):
            name = "_".join(part for part in (label, "" if mode and label else light) if part)
            if name in sets:
                raise BadInput("ablation", word, f"two rows are named {name}", hint="NAME=ROOT")
            row_source = replace(source, places=tuple(places.split("+")), modes=(light,))
            sets[name] = TrainingSet(name, row_source)
    return tuple(sets.values())
