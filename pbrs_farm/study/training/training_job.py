"""A training from views to figures, resumed if it was killed. Effects: the run's folder."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch

import pbrs_farm
from pbrs_farm.core.errors import PbrsError
from pbrs_farm.operating_system import processor_name
from pbrs_farm.study.networks.initial_weights import start_from
from pbrs_farm.study.networks.network_choice import n_weights, network_of
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.prediction import device_of, judge_views, score_predictions
from pbrs_farm.study.training.run_folder import FAILED, FINISHED, RunFolder
from pbrs_farm.study.training.training_curves import curves_svg, smooth_curve
from pbrs_farm.study.training.training_loop import (
    Judge,
    Observer,
    Share,
    seconds_a_step,
    share_of_process,
    train_network,
)
from pbrs_farm.study.training.training_views import TrainingViews, ViewArrays
from pbrs_farm.study.training_plan import TrainingPlan, plan_as_json

CURVE_THRESHOLDS: Final = 9  # number of thresholds for boundaries during training


@dataclass(frozen=True, slots=True)
class Job:
    """Arguments of a training."""

    plan: TrainingPlan
    out: Path
    seed: int = 0
    mode: str = "mlt_il_ol"  # lighting of the pictures
    source: str = ""  # places of the views
    init: str = "none"  # an argument of start_from
    stop_on: str = ""  # error whose minimum selects the weights; "" = last step
    facts: dict[str, Any] = field(default_factory=dict)  # more fields of the record


def train(
    job: Job,
    views: TrainingViews,
    held_out: ViewArrays | None = None,
    observe: Observer = lambda _row: None,
    also: Judge = lambda _network: {},
) -> dict[str, Any]:
    """Train and write weights, figures and curves; the figures, unless finished. also: more errors by name."""
    folder, plan = RunFolder(job.out), job.plan
    device_of(plan)
    share = share_of_process()
    if plan.threads > 0:
        torch.set_num_threads(plan.threads)
    # Draw random weights, then replace those that job.init has.
    task = task_of(plan.task)
    torch.manual_seed(job.seed)
    network = network_of(plan.network, task.n_out(plan), rays=plan.rays)
    origin = start_from(network, job.init)
    plan, timed = _faster(folder, network, views, plan, share)
    job = replace(job, plan=plan, facts=job.facts | timed)
    row = _record(job, views, held_out, origin) | {"weights": n_weights(network)}
    if not (folder.begin(row) if share.is_first else not folder.is_finished()):
        return folder.figures() if share.is_first else {}
    try:
        network = train_network(
            network,
            views,
            task,
            plan,
            seed=job.seed,
            folder=folder,
            observe=observe,
            judge=_judge_of_curve(views, held_out, plan, also),
            share=share,
            stop_on=job.stop_on,
        )
        if not share.is_first:
            return {}
        figures = _judge(network, views, held_out, plan, folder)
    except PbrsError as error:
        if share.is_first:
            folder.end(FAILED, error.message)
        raise
    folder.write("figures.json", figures)
    folder.write_text("curves.svg", _curves(folder, plan))
    for path in (folder.checkpoint, folder.best):
        path.unlink(missing_ok=True)
    folder.end(FINISHED, seconds=_seconds(folder, plan))
    return figures


def _faster(
    folder: RunFolder,
    network: torch.nn.Module,
    views: TrainingViews,
    plan: TrainingPlan,
    share: Share,
) -> tuple[TrainingPlan, dict[str, Any]]:
    """The plan with bfloat16 only if faster here, and times; a resumed run, a GPU and several processes keep it."""
    if not plan.bf16 or share.of > 1 or device_of(plan).type != "cpu":
        return plan, {}
    if (folder.root / "run.json").exists():
        seconds = folder.record().get("seconds_a_step")
    else:
        seconds = seconds_a_step(network, views, task_of(plan.task), plan)
    if seconds is None:
        return plan, {}
    return replace(plan, bf16=seconds["bfloat16"] < seconds["float32"]), {"seconds_a_step": seconds}


def _record(
    job: Job, views: TrainingViews, held_out: ViewArrays | None, origin: dict[str, str]
) -> dict[str, Any]:
    held_out_homes = list(held_out.homes) if held_out else []
    # The selected weights depend on the interval.
    stop = f"{job.stop_on}, each {job.plan.judge_every} steps" if job.stop_on else ""
    return {
        **({"stop_on": stop} if stop else {}),
        "task": job.plan.task,
        "plan": plan_as_json(job.plan),
        "seed": job.seed,
        "mode": job.mode,
        "source": job.source,
        "init": job.init,
        "init_origin": origin,
        "views": {"train": len(views), "held_out": len(held_out) if held_out else 0},
        "homes": {"train": list(views.homes), "held_out": held_out_homes},
        "views_digest": views.digest(),
        "truth": task_of(job.plan.task).truth,
        "versions": {
            "pbrs_farm": pbrs_farm.__version__,
            "torch": torch.__version__,
            "python": platform.python_version(),
        },
        "machine": _machine(job.plan),
        **job.facts,
    }


def _seconds(folder: RunFolder, plan: TrainingPlan) -> float:
    """Seconds of all steps by the logged rates, so that those before a kill count."""
    seconds, last = 0.0, 0.0
    for row in folder.metrics():
        if "views_s" in row:
            seconds += (row["step"] - last) * plan.batch / max(row["views_s"], 1e-9)
            last = row["step"]
    return round(seconds, 1)


def _machine(plan: TrainingPlan) -> str:
    """Name of the GPU or of the processor, and the number of cores."""
    device = device_of(plan)
    name = torch.cuda.get_device_name(device) if device.type == "cuda" else processor_name()
    return f"{name}, {os.cpu_count()} cores"


def _judge_of_curve(
    views: TrainingViews, held_out: ViewArrays | None, plan: TrainingPlan, also: Judge
) -> Judge:
    """Function from a network to its errors on a few training and held-out views."""
    task = task_of(plan.task, CURVE_THRESHOLDS)
    parts: dict[str, ViewArrays] = {}

    def judge(network: torch.nn.Module) -> dict[str, float]:
        if not parts:
            parts["train_error"] = views.decoded(plan.judge_views)
            if held_out:
                parts["held_out_error"] = held_out.some(plan.judge_views)
        errors = {
            name: task.error(judge_views(network, part, task, plan).figures)
            for name, part in parts.items()
        }
        return errors | also(network)

    return judge


def _judge(
    network: torch.nn.Module,
    views: TrainingViews,
    held_out: ViewArrays | None,
    plan: TrainingPlan,
    folder: RunFolder,
) -> dict[str, Any]:
    """Figures of the network and of the baseline on training and held-out views."""
    task = task_of(plan.task)
    parts = {"train": views.decoded(plan.final_views)}
    if held_out:
        parts["held_out"] = held_out.some(plan.final_views)
    # The baseline uses all training views in memory.
    known_views = views if isinstance(views, ViewArrays) else parts["train"]
    name, baseline = task.baseline(known_views.all_targets(), plan)
    np.save(folder.baseline, baseline)

    def of_baseline(part: ViewArrays) -> dict[str, float]:
        constant = (baseline for _ in part.ids)
        return score_predictions(constant, part.all_targets(), task, plan).figures

    return {
        "baseline_name": name,
        "views": {key: len(part) for key, part in parts.items()},
        "network": {k: judge_views(network, p, task, plan).figures for k, p in parts.items()},
        "baseline": {key: of_baseline(part) for key, part in parts.items()},
    }


def _curves(folder: RunFolder, plan: TrainingPlan) -> str:
    rows = folder.metrics()

    def points(name: str) -> list[tuple[float, float]]:
        return [(row["step"], row[name]) for row in rows if name in row]

    title = f"{plan.task}, plan {plan.name}"
    errors = {"training": points("train_error"), "held out": points("held_out_error")}
    names = dict.fromkeys(name for row in rows for name in row)
    errors |= {name[3:]: points(name) for name in names if name.startswith("on_")}
    panels = {f"{title}: loss": {"loss": smooth_curve(points("loss"))}}
    if any(errors.values()):
        panels[f"{title}: {task_of(plan.task).error_name}"] = errors
    return curves_svg(panels)
