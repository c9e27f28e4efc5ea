"""TensorBoard's and W&B's curves of a training equal metrics.jsonl."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import install_command
from pbrs_farm.study.training.loggers import loggers
from pbrs_farm.study.training.run_folder import RunFolder
from pbrs_farm.study.training.training_job import Job, train
from tests.study.training.made_views import small_plan, views

pytestmark = pytest.mark.study


def test_tensorboard_has_every_row_of_the_metrics(tmp_path: Path) -> None:
    pytest.importorskip("tensorboard")
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    plan = small_plan(steps="4", judge_every="2")
    with loggers(["tensorboard"], tmp_path, {}) as observe:
        train(Job(plan, tmp_path), views(3, plan), observe=observe)
    events = EventAccumulator(str(tmp_path / "tensorboard"))
    events.Reload()
    rows = RunFolder(tmp_path).metrics()
    for name in ("loss", "rate", "train_error"):
        rows_of_name = [(row["step"], row[name]) for row in rows if name in row]
        logged = [(event.step, event.value) for event in events.Scalars(name)]
        assert [step for step, _ in logged] == [step for step, _ in rows_of_name]
        assert [value for _, value in logged] == pytest.approx([value for _, value in rows_of_name])


def test_wandb_keeps_a_run_offline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("wandb")
    monkeypatch.setenv("WANDB_MODE", "offline")
    monkeypatch.setenv("WANDB_SILENT", "true")
    with loggers(["wandb"], tmp_path / "run", {"steps": 4}) as observe:
        observe({"step": 2, "loss": 0.25})
        observe({"step": 2, "train_error": 30.0})
    (file,) = (tmp_path / "run").rglob("*.wandb")
    words = (b"loss", b"0.25", b"train_error", b"steps")
    # W&B's process writes the file after the run has ended.
    until = time.monotonic() + 30
    while not all(word in file.read_bytes() for word in words) and time.monotonic() < until:
        time.sleep(0.1)
    assert all(word in file.read_bytes() for word in words)


def test_a_package_that_is_missing_names_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pbrs_farm.study.training.loggers.find_spec", lambda _name: None)
    with pytest.raises(MachineFailed) as error, loggers(["tensorboard"], tmp_path, {}):
        pass
    assert error.value.hint == install_command("tensorboard")
