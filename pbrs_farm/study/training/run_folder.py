"""The folder of a training run: its record, metrics, checkpoint, weights and figures. Effects: files.

    run.json                what was trained on what, by which plan, and whether it is finished
    metrics.jsonl           a line each plan.log_every steps
    checkpoint.safetensors  what a killed run goes on from; gone when it is finished
    best.safetensors        of a run that stops on a judge: the weights it liked best so far
    weights.safetensors     the trained weights
    baseline.npy            the prediction that needs no picture
    figures.json            how good it is, on training and held-out homes, beside the baseline
    curves.svg              loss, and error on training and held-out views, over the steps

A run is finished when run.json says so; that is written last.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.study.training_plan import TrainingPlan, plan_as_trained, plan_from_json

RUNNING, FINISHED, FAILED = "running", "finished", "failed"
_SAME: Final = ("task", "seed", "mode", "init", "views_digest", "stop_on")  # of a run that goes on


@dataclass(frozen=True, slots=True)
class RunFolder:
    """The paths of a run, and its record."""

    root: Path

    @property
    def checkpoint(self) -> Path:
        """What a killed run goes on from."""
        return self.root / "checkpoint.safetensors"

    @property
    def best(self) -> Path:
        """The weights that the judge who chooses liked best."""
        return self.root / "best.safetensors"

    @property
    def weights(self) -> Path:
        """The trained weights."""
        return self.root / "weights.safetensors"

    @property
    def baseline(self) -> Path:
        """The prediction that needs no picture."""
        return self.root / "baseline.npy"

    def record(self) -> dict[str, Any]:
        """run.json; BadInput where it is none."""
        path = self.root / "run.json"
        try:
            row = json.loads(path.read_bytes())
        except (FileNotFoundError, NotADirectoryError):
            raise BadInput(self.root, "", "not a run of `train`: no run.json") from None
        except (OSError, ValueError):
            raise BadInput(path, "", "not JSON: damaged") from None
        if not isinstance(row, dict) or not {"state", "task", "plan"} <= row.keys():
            raise BadInput(path, "", "not the record of a run")
        return row

    def is_finished(self) -> bool:
        """The folder holds a run that is finished."""
        return (self.root / "run.json").exists() and self.record()["state"] == FINISHED

    def begin(self, row: dict[str, Any]) -> bool:
        """Write the record of a run that begins or goes on; False where it is finished already.

        Raises BadInput where the folder holds a run of another task, plan, seed, mode or views.
        """
        if (self.root / "run.json").exists():
            older = self.record()
            self._check_same(older, row)
            if older["state"] == FINISHED:
                return False
        make_folder(self.root)
        self.write("run.json", {**row, "state": RUNNING})
        return True

    def _check_same(self, older: dict[str, Any], row: dict[str, Any]) -> None:
        """Raise BadInput where the run that stands here is of something else."""
        was, now = (_depends_on(one, str(self.root / "run.json")) for one in (older, row))
        for name, value in now.items():
            if was.get(name) != value:
                text = f"holds a run with another {name} {was.get(name)}, now {value}"
                raise BadInput(self.root, "", text, hint="give another --out")

    def end(self, state: str, why: str = "") -> None:
        """Say that the run is finished, or why it failed."""
        self.write("run.json", {**self.record(), "state": state, "why": why})

    def write(self, name: str, value: Any) -> None:
        """A file of JSON, whole or not at all."""
        self.write_text(name, json.dumps(value, indent=1, sort_keys=True) + "\n")

    def write_text(self, name: str, text: str) -> None:
        """A file of text, whole or not at all."""
        beside = self.root / f"{name}.part"
        beside.write_text(text, "utf-8")
        beside.replace(self.root / name)

    def figures(self) -> dict[str, Any]:
        """figures.json; BadInput where the run has none."""
        try:
            row: dict[str, Any] = json.loads((self.root / "figures.json").read_bytes())
        except (OSError, ValueError):
            raise BadInput(self.root, "figures.json", "missing or damaged: train again") from None
        return row

    def metrics(self) -> list[dict[str, float]]:
        """The rows of metrics.jsonl that are whole."""
        path, rows = self.root / "metrics.jsonl", []
        for line in path.read_text("utf-8").splitlines() if path.exists() else []:
            try:
                rows.append(json.loads(line))
            except ValueError:
                break  # cut off by a kill
        return rows

    def least(self, name: str) -> float:
        """The least value of a name in the metrics; infinity where there is none."""
        return min((row[name] for row in self.metrics() if name in row), default=math.inf)

    def keep_metrics_until(self, step: int) -> None:
        """Drop rows of steps that are done again."""
        rows = [row for row in self.metrics() if row["step"] <= step]
        self.write_text("metrics.jsonl", "".join(json.dumps(row) + "\n" for row in rows))

    def add_metrics(self, row: dict[str, float]) -> None:
        """Append a row."""
        with (self.root / "metrics.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def make_folder(path: Path) -> Path:
    """The folder, made where it was missing; BadInput where it cannot be written to."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        if os.access(path, os.W_OK):
            return path
        why = "not ours to write to"
    except OSError as error:
        why = error.strerror or "the system gave no reason"
    raise BadInput(path, "", f"no folder can be written there: {why}") from None


def finished_run(root: Path) -> tuple[RunFolder, dict[str, Any], TrainingPlan]:
    """The folder, record and plan of a run that is finished; BadInput for any other."""
    folder = RunFolder(root)
    row = folder.record()
    if row["state"] != FINISHED:
        text = f"the run is {row['state']}" + (f": {row['why']}" if row.get("why") else "")
        hint = "the same `train` goes on with it" if row["state"] == RUNNING else ""
        raise BadInput(root, "", text, hint=hint)
    return folder, row, plan_from_json(row["plan"], str(root / "run.json"))


def plan_digest(plan: TrainingPlan) -> str:
    """First 16 hex of the sha256 over every field that weights or figures depend on."""
    text = json.dumps(plan_as_trained(plan), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _depends_on(row: dict[str, Any], place: str) -> dict[str, Any]:
    """What two records of one run share, in words -> value; a plan of before has newer fields' defaults."""
    plan = plan_as_trained(plan_from_json(row["plan"], place))
    words = {f"{name}:": row.get(name) for name in _SAME}
    return words | {f"plan: {name}": value for name, value in plan.items()}
