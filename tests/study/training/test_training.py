"""Training learns, resumes after a kill, stops at NaN, and is never marked finished too early."""

from __future__ import annotations

import hashlib
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.study.tasks.tasks import task_of
from pbrs_farm.study.training.checkpoint import read_tensors
from pbrs_farm.study.training.run_folder import RunFolder, finished_run, plan_digest
from pbrs_farm.study.training.training_job import Job, train
from pbrs_farm.study.training.training_loop import LossFailed, seconds_a_step
from pbrs_farm.study.training.training_views import BatchOrder
from pbrs_farm.study.training_plan import TASKS, plan_as_trained, plan_of
from tests.study.training.made_views import SMALL, killed_plan, small_plan, views

pytestmark = pytest.mark.study

_KILLED = """
import os, signal, sys
from pathlib import Path
from tests.study.training.made_views import killed_plan, views
from pbrs_farm.study.training.training_job import Job, train

def killed(row):
    if row["step"] == 5:
        os.kill(os.getpid(), signal.SIGKILL)

plan = killed_plan(sys.argv[2])
train(Job(plan, Path(sys.argv[1]), seed=3), views(5, plan), observe=killed)
"""


_ALONE = """
import sys
for name in ("pydantic", "pydantic_core", "OpenImageIO", "scipy", "h5py", "jinja2", "PIL", "cv2"):
    sys.modules[name] = None
from pathlib import Path
from tests.study.training.made_views import small_plan, views
from pbrs_farm.study.training.training_job import Job, train
plan = small_plan(steps="2")
train(Job(plan, Path(sys.argv[1])), views(3, plan), views(2, plan))
"""


@pytest.mark.parametrize("task", TASKS)
def test_plan_lite_trains_every_task(task: str, tmp_path: Path) -> None:
    plan = plan_of(task, "lite", SMALL | {"steps": "2"})
    figures = train(Job(plan, tmp_path), views(3, plan))
    assert all(np.isfinite(list(figures["network"]["train"].values())))


@pytest.mark.parametrize("task", ["normals", "boundaries", "mean"])
def test_a_killed_run_resumes_to_the_same_weights(task: str, tmp_path: Path) -> None:
    plan = killed_plan(task)
    train(Job(plan, tmp_path / "whole", seed=3), views(5, plan))
    words = [sys.executable, "-c", _KILLED, str(tmp_path / "killed"), task]
    died = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert died.returncode == -signal.SIGKILL, died.stderr
    folder = RunFolder(tmp_path / "killed")
    assert folder.record()["state"] == "running"
    assert read_tensors(folder.checkpoint)[1].step == 4
    with pytest.raises(BadInput, match="the run is running"):
        finished_run(folder.root)

    train(Job(plan, tmp_path / "killed", seed=3), views(5, plan))
    whole, _ = read_tensors(RunFolder(tmp_path / "whole").weights)
    resumed, _ = read_tensors(folder.weights)
    assert whole.keys() == resumed.keys()
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)
    assert [row["step"] for row in folder.metrics()] == [1, 2, 3, 4, 5, 6]
    assert finished_run(folder.root)[1]["state"] == "finished"


def test_the_weights_are_those_of_the_best_validation(tmp_path: Path) -> None:
    plan = small_plan(steps="4", judge_every="1")
    weights: list[dict[str, torch.Tensor]] = []

    def also(network: torch.nn.Module) -> dict[str, float]:
        weights.append({name: x.clone() for name, x in network.state_dict().items()})
        return {"on_rooms": [9.0, 3.0, 5.0, 4.0][len(weights) - 1]}

    train(Job(plan, tmp_path, stop_on="on_rooms"), views(3, plan), also=also)
    stored, position = read_tensors(RunFolder(tmp_path).weights)
    assert position.step == 2
    assert all(torch.equal(stored[f"model.{name}"], x) for name, x in weights[1].items())
    assert not RunFolder(tmp_path).best.exists()
    longer = small_plan(steps="4", judge_every="2")
    with pytest.raises(BadInput, match="another stop_on"):
        train(Job(longer, tmp_path, stop_on="on_rooms"), views(3, longer), also=also)


def test_a_running_mean_of_weights_is_judged_kept_and_gone_on_with(tmp_path: Path) -> None:
    plan = small_plan(steps="4", average="0.5", judge_every="1", checkpoint_every="3")
    weights: list[dict[str, torch.Tensor]] = []

    def also(network: torch.nn.Module) -> dict[str, float]:
        weights.append({name: x.clone() for name, x in network.state_dict().items()})
        return {}

    train(Job(plan, tmp_path / "mean"), views(3, plan), also=also)
    plain = small_plan(steps="4", judge_every="1", checkpoint_every="3")
    means, weights = weights, []
    train(Job(plain, tmp_path / "plain"), views(3, plain), also=also)
    decays = [0.0, 2 / 11, 3 / 12, 4 / 13]  # (1 + n) / (10 + n), all below a half
    for name in ("head.weight", "stem.first.1.running_var"):
        mean = torch.zeros_like(weights[0][name])
        for share, step, average in zip(decays, weights, means, strict=True):
            mean = share * mean + (1 - share) * step[name]
            torch.testing.assert_close(average[name], mean)
    saved, _ = read_tensors(RunFolder(tmp_path / "mean").weights)
    assert all(torch.equal(saved[f"model.{name}"], x) for name, x in means[-1].items())


@pytest.mark.parametrize("slow", ["float32", "bfloat16"])
def test_bfloat16_is_used_if_its_step_is_faster_and_a_run_keeps_it(
    slow: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = small_plan(steps="1", bf16="true")
    timed = {name: 2.0 if name == slow else 1.0 for name in ("float32", "bfloat16")}
    where = "pbrs_farm.study.training.training_job.seconds_a_step"
    monkeypatch.setattr(where, lambda *_: timed)
    train(Job(plan, tmp_path), views(2, plan))
    assert RunFolder(tmp_path).record()["plan"]["bf16"] == (slow == "float32")
    monkeypatch.setattr(where, lambda *_: pytest.fail("measured again"))
    train(Job(plan, tmp_path), views(2, plan))


def test_measuring_a_step_leaves_the_network_unchanged() -> None:
    plan = small_plan()
    network = torch.nn.Conv2d(3, 3, 1)
    before = network.weight.clone()
    seconds = seconds_a_step(network, views(2, plan), task_of("normals"), plan)
    assert set(seconds) == {"float32", "bfloat16"}
    assert min(seconds.values()) > 0
    assert torch.equal(network.weight, before)


def test_a_finished_run_is_not_trained_again(tmp_path: Path) -> None:
    plan = small_plan(steps="2", hue="0")
    first = train(Job(plan, tmp_path), views(3, plan))
    steps: list[dict[str, float]] = []
    assert train(Job(plan, tmp_path), views(3, plan), observe=steps.append) == json.loads(
        json.dumps(first)
    )
    assert steps == []


def test_a_loss_that_is_no_number_names_the_view(tmp_path: Path) -> None:
    plan = small_plan(steps="4", rate="1e18", clip_norm="0", noise="0")
    with pytest.raises(LossFailed, match=r"not a finite number at step \d, at view home-"):
        train(Job(plan, tmp_path), views(3, plan))
    record = RunFolder(tmp_path).record()
    assert record["state"] == "failed"
    assert "home-" in record["why"]
    assert not RunFolder(tmp_path).weights.exists()


def test_a_folder_of_another_plan_or_task_is_refused(tmp_path: Path) -> None:
    plan = small_plan(steps="2")
    train(Job(plan, tmp_path), views(3, plan))
    longer = small_plan(steps="3")
    with pytest.raises(BadInput, match="another plan: steps 2, now 3"):
        train(Job(longer, tmp_path), views(3, longer))
    edges = small_plan("boundaries", steps="2")
    with pytest.raises(BadInput, match="another task"):
        train(Job(edges, tmp_path), views(3, edges))
    with pytest.raises(BadInput, match="another seed: 0, now 1"):
        train(Job(plan, tmp_path, seed=1), views(3, plan))


def test_another_network_does_not_start_from_a_run_it_shares_nothing_with(tmp_path: Path) -> None:
    plan = small_plan(steps="2")
    train(Job(plan, tmp_path / "a"), views(3, plan))
    edges = small_plan("boundaries", steps="2")
    with pytest.raises(BadInput, match="no weight of it fits"):
        train(Job(edges, tmp_path / "b", init=str(tmp_path / "a")), views(3, edges))
    tuned = train(Job(plan, tmp_path / "c", init=str(tmp_path / "a")), views(3, plan))
    assert tuned["network"]["train"]["n_pixels"] > 0
    assert "run of normals" in RunFolder(tmp_path / "c").record()["init_origin"]["source"]


@pytest.mark.skipif(torch.cuda.is_available(), reason="says what happens without a GPU")
def test_a_plan_for_a_gpu_reports_that_there_is_none(tmp_path: Path) -> None:
    with pytest.raises(MachineFailed, match="asks for a GPU"):
        train(Job(small_plan(device="cuda"), tmp_path), views(3, small_plan()))
    assert not (tmp_path / "run.json").exists()


def test_checkpoints_with_noise_of_one_strength_are_of_another_plan() -> None:
    for noise, is_same in (("0", True), ("0.02", False)):
        plan = small_plan(noise=noise)
        text = json.dumps(plan_as_trained(plan), sort_keys=True)
        before = hashlib.sha256(text.encode()).hexdigest()[:16]
        assert (plan_digest(plan) == before) == is_same


def test_a_damaged_checkpoint_is_refused(tmp_path: Path) -> None:
    (tmp_path / "checkpoint.safetensors").write_bytes(b"not a checkpoint")
    plan = small_plan(steps="2")
    with pytest.raises(BadInput, match="not a checkpoint"):
        train(Job(plan, tmp_path), views(3, plan))
    assert RunFolder(tmp_path).record()["state"] == "failed"


def test_every_view_is_taken_once_a_round() -> None:
    order = BatchOrder(7, 3, seed=5)
    rows = np.concatenate([order.rows(step) for step in range(7)])
    for k in range(3):
        assert sorted(rows[7 * k : 7 * k + 7]) == list(range(7))
    assert not np.array_equal(rows[:7], rows[7:14])
    # A run resumed at the fifth step uses the same views.
    assert np.array_equal(BatchOrder(7, 3, seed=5).rows(4), rows[12:15])


def test_views_of_shards_come_from_four_shards_at_a_time() -> None:
    groups = np.repeat(np.arange(12), 10)
    order = BatchOrder(120, 40, seed=1, groups=groups)
    rounds = [np.concatenate([order.rows(3 * k + i) for i in range(3)]) for k in range(2)]
    for rows in rounds:
        assert sorted(rows) == list(range(120))
        windows = [set(groups[rows[40 * i : 40 * i + 40]]) for i in range(3)]
        assert [len(window) for window in windows] == [4, 4, 4]
        # Shards are mixed within them.
        assert len(set(groups[rows[:10]])) > 1
    assert not np.array_equal(*rounds)


def test_four_views_can_be_learnt_by_heart(tmp_path: Path) -> None:
    plan = plan_of(
        "normals", "tiny",
        {"width_px": "80", "height_px": "60", "batch": "4", "steps": "60", "threads": "1",
         "flip": "false", "gain": "0", "gamma": "0", "tint": "0", "hue": "0", "noise": "0"},
    )  # fmt: skip
    figures = train(Job(plan, tmp_path), views(4, plan))
    assert figures["network"]["train"]["mean_deg"] < 12


def test_errors_on_training_and_held_out_views_are_drawn(tmp_path: Path) -> None:
    plan = small_plan(judge_every="3")
    train(Job(plan, tmp_path / "a"), views(4, plan), views(2, plan))
    rows = [row for row in RunFolder(tmp_path / "a").metrics() if "held_out_error" in row]
    assert [row["step"] for row in rows] == [3, 6]
    assert all(0 < row["train_error"] < 180 for row in rows)
    picture = (tmp_path / "a" / "curves.svg").read_text()
    assert picture.count("<polyline") == 3
    assert "mean angle, degrees" in picture
    # Validation changes nothing: the weights equal those of a run without it.
    blind = small_plan()
    train(Job(blind, tmp_path / "b"), views(4, plan), views(2, plan))
    judged, unseen = (read_tensors(RunFolder(tmp_path / x).weights)[0] for x in "ab")
    assert all(torch.equal(judged[name], unseen[name]) for name in judged)


def test_a_run_older_than_a_field_is_resumed(tmp_path: Path) -> None:
    plan = small_plan(steps="2", hue="0")
    first = train(Job(plan, tmp_path), views(3, plan))
    record = RunFolder(tmp_path).record()
    for name in (
        "hue",
        "average",
        "workers",
        "memory_gb",
        "judge_every",
        "judge_views",
        "final_views",
    ):
        del record["plan"][name]
    RunFolder(tmp_path).write("run.json", record)
    assert train(Job(plan, tmp_path), views(3, plan))["network"] == first["network"]


def test_a_place_that_is_no_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    plan = small_plan(steps="2")
    for out in (tmp_path / "file", tmp_path / "file" / "run"):
        with pytest.raises(BadInput, match="no folder can be written there"):
            train(Job(plan, out), views(3, plan))


@pytest.mark.parametrize("network", ["small", "residual"])
def test_a_size_that_the_network_cannot_halve_is_one_line(network: str) -> None:
    with pytest.raises(BadInput, match=f"33x32: network {network} needs even numbers"):
        small_plan(width_px="33", network=network)
    assert small_plan("boundaries", width_px="33").width_px == 33


def test_pictures_of_32_pixels_are_too_small_for_the_residual_network(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="32x32: network residual needs sides above 32 pixels"):
        small_plan(width_px="32", height_px="32")
    least = small_plan(width_px="34", height_px="32", batch="1", steps="1")
    assert train(Job(least, tmp_path), views(1, least))["network"]["train"]["mean_deg"] < 180


def test_a_plans_fields_are_set_and_checked() -> None:
    assert plan_of("normals", "paper", {"rate": "0.01", "bf16": "true"}).rate == 0.01
    for name, text in (("rate", "fast"), ("colour", "1"), ("batch", "0"), ("device", "tpu")):
        with pytest.raises(BadInput, match=name):
            plan_of("normals", "tiny", {name: text})
    with pytest.raises(BadInput, match="no such plan"):
        plan_of("normals", "huge")


def test_training_needs_only_torch_and_numpy(tmp_path: Path) -> None:
    words = [sys.executable, "-c", _ALONE, str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert finished_run(tmp_path)[1]["task"] == "normals"
