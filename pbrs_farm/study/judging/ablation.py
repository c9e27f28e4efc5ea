"""The paper's comparison: one network trained on several sets of views, judged on the same ones. Effects: files.

Each set is trained with each seed; every set has the same number of views and steps, so that a row
differs from another by its pictures alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.judging.evaluation import JudgedViews, evaluate, open_run
from pbrs_farm.study.judging.figure_text import is_underfit, markdown, spread_text, title_of
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
    """What is compared. out: a folder for all runs, each gone on with where it was killed."""

    sets: tuple[TrainingSet, ...]
    plan: TrainingPlan
    out: Path
    n_seeds: int = 3
    equal_views: bool = True
    exact: bool = False  # boundaries at 99 thresholds


def compare(
    comparison: Comparison, judged_on: Sequence[JudgedViews], tell: Tell = lambda _line: None
) -> dict[str, Any]:
    """Train every set with every seed and judge each on everything; the figures by set and seed.

    With equal views every set is cut to the size of the smallest. Every set has the same plan and
    the same seeds, so a difference comes from the views. tell hears a line a set.
    """
    plan, rows = comparison.plan, {}
    loaded = [training_views(each.source, plan) for each in comparison.sets]
    if comparison.equal_views:
        fewest = min(len(views) for views in loaded)
        loaded = [views.some(fewest) for views in loaded]
    for each, views in zip(comparison.sets, loaded, strict=True):
        held_out = held_out_views(each.source, plan)
        runs = [
            _one(comparison, each, views, held_out, judged_on, seed)
            for seed in range(comparison.n_seeds)
        ]
        rows[each.name] = {"mode": each.source.modes[0], "views": len(views), "seeds": runs}
        tell(f"{each.name}: {_line(rows[each.name], plan)}")
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


def _one(
    comparison: Comparison, each: TrainingSet, views: TrainingViews, held_out: ViewArrays | None,
    judged_on: Sequence[JudgedViews], seed: int,
) -> dict[str, Any]:  # fmt: skip
    out = comparison.out / each.name / f"seed{seed}"
    source = each.source
    job = Job(comparison.plan, out, seed, source.modes[0], source.name)
    figures = train(job, views, held_out)
    run = open_run(out, exact=comparison.exact)
    others = {on.name: evaluate(run, on) for on in judged_on}
    return {
        **figures,
        "on": {
            name: {row: judged.figures for row, judged in one.rows.items()}
            for name, one in others.items()
        },
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
    """Rows by set: views, training and own held-out homes, then each set judged on, and the paper."""
    task = task_of(result["task"])
    figure = task.figures[0]
    others = list(result["judged_on"])
    head = ["trained on", "views", "training homes", "held-out homes, own light"]
    head += [f"{name} ({result['judged_on'][name]['n_views']})" for name in others]
    rows, underfit = [], []
    for name, row in result["rows"].items():
        runs = row["seeds"]
        cells = [
            _figure_cell(figure, [run["network"].get(part) for run in runs])
            for part in ("train", "held_out")
        ]
        cells += [
            _figure_cell(figure, [run["on"][other]["network"] for run in runs]) for other in others
        ]
        paper = paper_row(task.name, row["mode"], result["n_classes"])
        known = paper.figures[0] if paper and not paper.tuned else float("nan")
        rows.append([name, str(row["views"]), *cells, spread_text(figure, [known])])
        if any(_is_underfit(task.name, run) for run in runs):
            underfit.append(name)
    rows.append(_baseline_row(result, figure, others))
    text = markdown([*head, "paper, NYUv2"], rows)
    n = _n_seeds(result)
    spread = f"± is the standard deviation of {n} seeds" if n > 1 else _ONE_SEED
    said = [f"{title_of(figure)}; {spread}."]
    if underfit:
        said.append(f"underfit, rank nothing by it: {', '.join(underfit)}.")
    said += [f"Truth of {name}: {on['truth']}." for name, on in result["judged_on"].items()]
    return text + "\n\n" + "\n".join(said) + "\n"


def _figure_cell(figure: str, figures: Sequence[dict[str, float] | None]) -> str:
    values = [row[figure] for row in figures if row is not None]
    return spread_text(figure, values) if values else "-"


def _baseline_row(result: dict[str, Any], figure: str, others: Sequence[str]) -> list[str]:
    """The baseline of the first set: what is known without a picture."""
    row = next(iter(result["rows"].values()))
    run = row["seeds"][0]
    name = run["baseline_name"]
    parts = [_figure_cell(figure, [run["baseline"].get(part)]) for part in ("train", "held_out")]
    parts += [_figure_cell(figure, [run["on"][other][name]]) for other in others]
    return [f"baseline: {name}", "-", *parts, "-"]


def _n_seeds(result: dict[str, Any]) -> int:
    return len(next(iter(result["rows"].values()))["seeds"])


def _is_underfit(task_name: str, run: dict[str, Any]) -> bool:
    error = task_of(task_name).error
    return is_underfit(error(run["network"]["train"]), error(run["baseline"]["train"]))


def hold_out_notes(sets: Sequence[TrainingSet]) -> list[str]:
    """What is said of homes to hold out that some rows lack; BadInput for one that all rows lack."""
    missing = {each.name: missing_of(each.source) for each in sets}
    everywhere = set.intersection(*(set(names) for names in missing.values()))
    if everywhere:
        places = ", ".join(dict.fromkeys(each.source.name for each in sets))
        raise BadInput("--hold-out", min(everywhere), f"no such home in {places}")
    return [
        f"{row} has no home {', '.join(names)} to hold out"
        for row, names in missing.items()
        if names
    ]


def training_sets(
    words: Sequence[str], modes: Sequence[str], source: TrainingSource
) -> tuple[TrainingSet, ...]:
    """Rows of `[NAME=]ROOT[+ROOT][@MODE]`, one for each mode where none is named.

    source: what all rows have in common. Raises BadInput for two rows of one name.
    """
    sets: dict[str, TrainingSet] = {}
    for word in words:
        label, equals, rest = word.partition("=")
        label, rest = (label, rest) if equals else ("", word)
        places, _, mode = rest.partition("@")
        if places.endswith(".mat"):
            hint = "`train TASK nyu.mat --init RUN` tunes a run on it"
            raise BadInput("ablation", word, "photographs have none of the four lights", hint=hint)
        for one in (mode,) if mode else tuple(modes):
            name = "_".join(part for part in (label, "" if mode and label else one) if part)
            if name in sets:
                raise BadInput("ablation", word, f"a second row called {name}", hint="NAME=ROOT")
            each = replace(source, places=tuple(places.split("+")), modes=(one,))
            sets[name] = TrainingSet(name, each)
    return tuple(sets.values())
