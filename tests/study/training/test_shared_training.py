"""Two processes of torchrun share each batch; only the first writes the run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from pbrs_farm.store.folder import FolderStore
from pbrs_farm.study.networks.network_choice import network_of
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.run_folder import RunFolder, finished_run
from pbrs_farm.study.training.training_loop import Share, train_network
from tests.study.training.made_views import small_plan, views
from tests.views.small_roots import fill

pytestmark = pytest.mark.study
_FIELDS = "width_px=40 height_px=32 batch=2 steps=4 judge_every=2 threads=1 log_every=1"


def test_two_processes_train_one_network(tmp_path: Path) -> None:
    fill(FolderStore(tmp_path / "root"), {"a-00000000": 2, "b-00000000": 2}, (40, 32))
    words = (
        "-m torch.distributed.run --standalone --nproc-per-node 2 -m pbrs_farm.cli train normals"
    )
    words += f" {tmp_path / 'root'} --hold-out b --out {tmp_path / 'run'}"
    line = [*words.split(), *(word for field in _FIELDS.split() for word in ("--set", field))]
    done = subprocess.run([sys.executable, *line], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    folder, record, _plan = finished_run(tmp_path / "run")
    assert record["views"] == {"train": 2, "held_out": 2}
    rows = [json.loads(line) for line in (folder.root / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows if "loss" in row] == [1, 2, 3, 4]
    assert [row["step"] for row in rows if "held_out_error" in row] == [2, 4]


def test_a_process_that_is_not_the_first_writes_no_file(tmp_path: Path) -> None:
    plan = small_plan(steps="2", judge_every="1")
    task = task_of("normals")
    folder = RunFolder(tmp_path)
    network = network_of(plan.network, task.n_out(plan))
    train_network(
        network, views(3, plan), task, plan, seed=0, folder=folder, observe=lambda _row: None,
        judge=lambda _network: {}, share=Share(rank=1, of=1),
    )  # fmt: skip
    assert list(tmp_path.iterdir()) == []
