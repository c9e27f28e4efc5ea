"""The folder of a training run: its record, metrics, checkpoint, weights and figures. Effects: files.

    run.json                task, plan, views and state of the run
    metrics.jsonl           a line each plan.log_every steps
    checkpoint.safetensors  state to resume from; deleted at the end
    best.safetensors        weights with the least error so far, of a run with stop_on
    weights.safetensors     the trained weights
    baseline.npy            the best constant prediction
    figures.json            figures on training and held-out homes, with those of the baseline
    curves.svg              loss, and error on training and held-out views, over the steps

The state "finished" of run.json is written last.
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
_SAME: Final = (
    "task",
    "seed",
    "mode",
    "init",
    "views_digest",
    "stop_on",
)  # fields that a resumed run must share


@dataclass(frozen=True, slots=True)
class RunFolder:
    """Files of a run."""

    root: Path

    @property
    def checkpoint(self) -> Path:
        """State to resume from."""
        return self.root / "checkpoint.safetensors"

    @property
    def best(self) -> Path:
        """Weights with the least error so far, for stop_on."""
        return self.root / "best.safetensors"

    @property
    def weights(self) -> Path:
        """The trained weights."""
        return self.root / "weights.safetensors"

    @property
    def baseline(self) -> Path:
        """The best constant prediction."""
        return self.root / "baseline.npy"

    def record(self) -> dict[str, Any]:
        """Content of run.json; BadInput if it is damaged."""
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
        """True if the run is finished."""
        return (self.root / "run.json").exists() and self.record()["state"] == FINISHED

    def begin(self, row: dict[str, Any]) -> bool:
        """Write the record of a run; False if finished already, BadInput if it is another run's folder."""
        if (self.root / "run.json").exists():
            older = self.record()
            was, now = (_identity(r, str(self.root / "run.json")) for r in (older, row))
            for name, value in now.items():
                if was.get(name) != value:
                    text = f"has a run with another {name} {was.get(name)}, now {value}"
                    raise BadInput(self.root, "", text, hint="give another --out")
            if older["state"] == FINISHED:
                return False
        make_folder(self.root)
        self.write("run.json", {**row, "state": RUNNING})
        return True

    def end(self, state: str, why: str = "", **facts: Any) -> None:
        """Write the final state, the reason of a failure and facts known only at the end."""
        self.write("run.json", {**self.record(), **facts, "state": state, "why": why})

    def write(self, name: str, value: Any) -> None:
        """Write a file of JSON, complete or not at all."""
        self.write_text(name, json.dumps(value, indent=1, sort_keys=True) + "\n")

    def write_text(self, name: str, text: str) -> None:
        """Write a file of text, complete or not at all."""
        beside = self.root / f"{name}.part"
        beside.write_text(text, "utf-8")
        beside.replace(self.root / name)

    def figures(self) -> dict[str, Any]:
        """Content of figures.json; BadInput if it is missing or damaged."""
        try:
            row: dict[str, Any] = json.loads((self.root / "figures.json").read_bytes())
        except (OSError, ValueError):
            raise BadInput(self.root, "figures.json", "missing or damaged: train again") from None
        return row

    def metrics(self) -> list[dict[str, float]]:
        """The complete rows of metrics.jsonl."""
        path, rows = self.root / "metrics.jsonl", []
        for line in path.read_text("utf-8").splitlines() if path.exists() else []:
            try:
                rows.append(json.loads(line))
            except ValueError:
                break  # truncated by a kill
        return rows

    def least(self, name: str) -> float:
        """The least value of a name in the metrics; infinity without any."""
        return min((row[name] for row in self.metrics() if name in row), default=math.inf)

    def keep_metrics_until(self, step: int) -> None:
        """Drop the rows of later steps, which are repeated."""
        rows = [row for row in self.metrics() if row["step"] <= step]
        self.write_text("metrics.jsonl", "".join(json.dumps(row) + "\n" for row in rows))

    def add_metrics(self, row: dict[str, float]) -> None:
        """Append a row."""
        with (self.root / "metrics.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def make_folder(path: Path) -> Path:
    """Create a folder if needed; BadInput if it is not writable."""
    try:
        path.mkdir(parents=True, exist_ok=True)
        if os.access(path, os.W_OK):
            return path
        why = "not ours to write to"
    except OSError as error:
        why = error.strerror or "the system gave no reason"
    raise BadInput(path, "", f"no folder can be written there: {why}") from None


def write_report(out: Path, name: str, value: Any, html: str) -> Path:
    """Write a JSON file and index.html into a folder; the page's path. BadInput if it is not writable."""
    make_folder(out)
    (out / name).write_text(json.dumps(value, indent=1) + "\n", "utf-8")
    page = out / "index.html"
    page.write_text(html, "utf-8")
    return page


def finished_run(root: Path) -> tuple[RunFolder, dict[str, Any], TrainingPlan]:
    """Folder, record and plan of a finished run; BadInput for any other."""
    folder = RunFolder(root)
    row = folder.record()
    if row["state"] != FINISHED:
        text = f"the run is {row['state']}" + (f": {row['why']}" if row.get("why") else "")
        hint = "run the same `train` to resume it" if row["state"] == RUNNING else ""
        raise BadInput(root, "", text, hint=hint)
    return folder, row, plan_from_json(row["plan"], str(root / "run.json"))


def plan_digest(plan: TrainingPlan) -> str:
    """First 16 hex digits of the sha256 over every field that affects weights or figures."""
    row = plan_as_trained(plan)
    if plan.noise > 0:
        row["noise"] = [plan.noise, "at most"]  # once it was the strength in every view
    text = json.dumps(row, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _identity(row: dict[str, Any], place: str) -> dict[str, Any]:
    """Title -> value of the fields of a record that a resumed run must share."""
    plan = plan_as_trained(plan_from_json(row["plan"], place))
    titles = {f"{name}:": row.get(name) for name in _SAME}
    return titles | {f"plan: {name}": value for name, value in plan.items()}
