"""A finished run packed for sharing: half floats, their sha256, a model card. Effects: files.

A packed run is a run: `predict`, `evaluate` and `--init` take it. The best ones are the
package pbrs-farm-weights, which a checkout has in deploy/weights.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path, PurePosixPath
from typing import Any, Final

import numpy as np

from pbrs_farm.core.errors import BadInput
from pbrs_farm.installation import checkout_folder, need
from pbrs_farm.progress import seconds_text
from pbrs_farm.study.judging.evaluation import Trained, open_run, parts_tables, trained_columns
from pbrs_farm.study.judging.figure_text import markdown, shown_figure, title_of
from pbrs_farm.study.training.checkpoint import read_tensors, write_tensor_file
from pbrs_farm.study.training.run_folder import RunFolder, make_folder
from pbrs_farm.study.training.view_sources import NYU_LIGHT, PHOTO_LIGHT
from pbrs_farm.study.training_plan import plan_as_json

_TOLD_RAYS: Final = " and the direction of each pixel's ray (`predict --hfov`)"
_PREDICTS: Final = {
    "normals": "the surface normal at each pixel",
    "segmentation": "one of NYU's {n_classes} classes for each pixel",
    "depth": "metres along the camera's axis",
    "boundaries": "the probability of an object boundary at each pixel",
}
_MOST_HOMES: Final = 12  # number of homes named on the card
_LOCAL: Final = re.compile(r"(?<![^\s='\"])/(?:[^/\s'\"]+/)*")
"""Folders of this machine, in commands."""


def weights_folder() -> Path:
    """The folder of the shipped weights, with one folder a task; MachineFailed without their package."""
    checkout = checkout_folder()
    if checkout is not None:
        return checkout / "deploy" / "weights" / "pbrs_farm_weights"
    need("pbrs_farm_weights")
    return Path(str(files("pbrs_farm_weights")))


def shipped_run(task: str) -> Path:
    """Folder of the shipped weights of a task; BadInput for a task without shipped weights."""
    folder = weights_folder() / task
    if not (folder / "run.json").exists():
        tasks = sorted(path.parent.name for path in weights_folder().glob("*/run.json"))
        hint = f"shipped weights: {', '.join(tasks)}" if tasks else "pbrs-farm predict RUN PHOTO..."
        raise BadInput("--task", task, "the package has no weights for this task", hint=hint)
    return folder


def pack_weights(root: Path, out: Path, *, made_by: Sequence[str] = ()) -> RunFolder:
    """Write a finished run as half floats, record and card with results and commands; BadInput for others.

    made_by: commands before the training.
    """
    run, packed = open_run(root), RunFolder(make_folder(out))
    tensors, position = read_tensors(run.folder.weights)
    halves = {name: x.half() if x.is_floating_point() else x for name, x in tensors.items()}
    write_tensor_file(packed.weights, halves, {"position": json.dumps(asdict(position))})
    np.save(packed.baseline, run.baseline.astype(np.float16))
    packed.write("figures.json", run.figures)
    # Omit local paths.
    names = [PurePosixPath(place).name for place in str(run.record["source"]).split(" + ")]
    digest = hashlib.sha256(packed.weights.read_bytes()).hexdigest()
    origin = {k: v for k, v in run.record["init_origin"].items() if k != "file"}
    record = run.record | {"source": " + ".join(names), "weights_sha256": digest}
    record |= {"init": PurePosixPath(record["init"]).name, "init_origin": origin}
    report = _report(root)
    commands = [*made_by, record.pop("command", ""), report.get("command", "")]
    record["made_by"] = [_LOCAL.sub("", command) for command in commands if command]
    packed.write("run.json", record | {"plan": plan_as_json(run.plan), "step": position.step})
    evaluations = report.get("evaluations", [])
    # Omit the errors of single views.
    packed.write("judged.json", [row | {"errors": {}} for row in evaluations])
    card = model_card(run, record | {"step": position.step}, evaluations)
    packed.write_text("README.md", card)
    return packed


def _report(root: Path) -> dict[str, Any]:
    """Content of the run's evaluation.json; {} if it was not evaluated."""
    path = root / "evaluation" / "evaluation.json"
    report: dict[str, Any] = json.loads(path.read_bytes()) if path.exists() else {}
    return report


def model_card(run: Trained, record: Mapping[str, Any], evaluations: list[dict[str, Any]]) -> str:
    """Description of the weights, their training, figures and limits: Markdown."""
    plan, task = run.plan, run.task
    size = f"{plan.width_px}x{plan.height_px}"
    homes = record["homes"]["train"]
    stop = record.get("stop_on", "")
    chosen = f"step {record['step']:,} of {plan.steps:,}"
    machine = f"; {record['machine']}" if "machine" in record else ""
    machine += f", {seconds_text(record['seconds'])}" if "seconds" in record else ""
    commands = "\n".join(record.get("made_by", ()))
    chosen += f", chosen by the error on {stop.removeprefix('on_')}" if stop else ""
    parts = [
        f"---\ntags: [{task.name}, indoor, synthetic-data]\nlibrary_name: pbrs-farm\n---",
        f"# {task.name}, plan {plan.name}",
        f"Predicts {_PREDICTS[task.name].format(n_classes=plan.n_classes)}, from one colour picture of a room{_TOLD_RAYS * plan.rays}. Network `{plan.network}`,"
        f" {record['weights']:,} weights in half floats, trained at {size}.",
        "```\npbrs-farm predict FOLDER PHOTO... --out seen\n```",
        "FOLDER is the folder of this card; for weights of the package, `--task` also works.",
        "## Training data",
        _seen(record, homes),
        f"Initial weights: {record['init_origin']['source']}. Weights of {chosen}; seed {record['seed']};"
        f" pbrs_farm {record['versions']['pbrs_farm']}, torch {record['versions']['torch']}{machine}.",
        *([f"Made by:\n\n```\n{commands}\n```"] if commands else []),
        f"Truth: {record['truth']}.",
        "## Figures",
        _figures(run, evaluations),
        *filter(None, [parts_tables(evaluations)]),
        *(f"Truth of {row['on']}: {row['truth']}." for row in evaluations),
        *(
            f"Predictions of {row['on']} are averaged with those of the mirrored pictures."
            for row in evaluations
            if row.get("mirror")
        ),
        "## Limits",
        f"A small network at {size}, trained on few pictures: not for measuring or for safety."
        " It was trained on rooms of homes by day and by lamplight, not on other places, people,"
        " animals or close-ups.",
        "## Credits of the training data",
        "\n".join(f"- {line}" for line in _training_credits(record)) or "The run has no credits.",
        f"weights.safetensors, sha256 {record['weights_sha256']}",
    ]
    return "\n\n".join(parts) + "\n"


def _seen(record: Mapping[str, Any], homes: Sequence[str]) -> str:
    """Description of the pictures that trained the weights and their first weights."""
    n, first = record["views"]["train"], record["init_origin"].get("mode", "")
    if record["mode"] == NYU_LIGHT:
        return f"{n:,} photographs of NYU Depth v2 (Silberman et al., 2012), labelled there."
    real = [
        f"{len(row['pictures']):,} photographs with depth of {row['name']}"
        + (f", {row['share']:g} of each batch" if "share" in row else "")
        for row in record.get("photographs", ())
    ]
    if record["mode"] == PHOTO_LIGHT:
        return f"{'; '.join(real)}."
    named = f"{', '.join(homes[:_MOST_HOMES])}{' and others' if len(homes) > _MOST_HOMES else ''}"
    text = f"{n:,} rendered views of {len(homes)} homes in light `{record['mode']}`: {named}."
    if first == NYU_LIGHT:
        return f"{text} The initial weights used NYU Depth v2 (Silberman et al., 2012)."
    photographs = record["init_origin"].get("photographs")
    first = f"; the initial weights used {photographs}" if photographs else ""
    return f"{text} {'Beside them ' + '; '.join(real) if real else 'No photograph was trained on'}{first}."


def _training_credits(record: Mapping[str, Any]) -> list[str]:
    """Each credit line once, without headings."""
    lines = (str(line).removeprefix("- ") for line in record.get("credits", []))
    return list(dict.fromkeys(line for line in lines if not line.endswith(":")))


def _figures(run: Trained, evaluations: list[dict[str, Any]]) -> str:
    """Table of figures with those of the baseline in brackets."""
    baseline_name = run.figures["baseline_name"]
    columns = trained_columns(run)
    for row in evaluations:
        figures, title = row["figures"], f"{row['on']} ({row['n_views']})"
        columns.append((title, figures["network"], figures[baseline_name]))
    rows = [
        [title_of(name)]
        + [
            f"{shown_figure(name, net[name])} ({shown_figure(name, base[name])})"
            for _, net, base in columns
        ]
        for name in run.task.figures
    ]
    text = markdown(["", *(title for title, _, _ in columns)], rows)
    return f"{text}\n\nIn brackets: {baseline_name}, a constant prediction."
