from __future__ import annotations

import pytest

from pbrs_farm.core.errors import BadInput
from tests.workers.conftest import spec
from workers.ids import (
    TaskId,
    attempts_from_log_keys,
    check_job_id,
    failed_key,
    group_text,
    log_key,
    queue_of,
    stages_of_queue,
    task_from_failed_key,
    task_from_text,
    tasks_from_group,
)
from workers.node.house_runner import steps_before_views, steps_of_stage


@pytest.mark.parametrize(
    "text", ["", "a/b", "a/b/c", "a/0/gl/x", "../x/gl", "a/0/rm -rf", "a\n/0/gl", "a/0/gl\n"]
)
def test_an_invalid_task_is_refused(text: str) -> None:
    with pytest.raises(BadInput, match="not a task"):
        task_from_text(text)


def test_ids_read_back() -> None:
    assert str(task_from_text("studio-1a2b/3/light")) == "studio-1a2b/3/light"
    assert str(task_from_text("-/s3/shard")) == "-/s3/shard"
    with pytest.raises(BadInput):
        check_job_id("../../etc")


def test_every_stage_has_a_queue_and_back() -> None:
    for stage in ("geometry", "gl", "light", "reduce", "shard", "job"):
        for gpu in (False, True):
            assert stage in stages_of_queue(queue_of(stage, gpu=gpu))
    assert queue_of("light", gpu=True) == "light.gpu"


def test_the_last_stage_of_a_batch_writes_the_view() -> None:
    both_stages = spec(1)
    assert steps_of_stage(both_stages, "gl") == ("truth", "opengl_dl", "opengl_il")
    assert steps_of_stage(both_stages, "light")[-1] == "view"
    only_gl = both_stages.model_copy(update={"modes": ("opengl_dl",), "batch_stages": ("gl",)})
    assert steps_of_stage(only_gl, "gl") == ("truth", "opengl_dl", "view")


def test_requested_pairs_are_made_with_their_house() -> None:
    assert steps_before_views(spec(1), "home-1")[:2] == ("house", "cameras")
    paired = spec(1).model_copy(update={"pairs": True})
    assert steps_before_views(paired, "home-1")[-1] == "pairs"
    assert "pairs" not in steps_before_views(paired, "object_chair")


def test_keys_of_logs_and_failures_name_their_task_back() -> None:
    job = "0123456789ab"
    for task in ("h1/0/light", "h1/-/geometry", "-/s3/shard", "-/-/job"):
        assert task_from_failed_key(job, failed_key(job, task)) == task
        logs = [log_key(job, task, k) for k in (1, 12)]
        other_keys = [log_key(job, "h1/1/light", 1), log_key(job, "h1/0/gl", 1)]
        assert attempts_from_log_keys(job, task, [*other_keys, *logs]) == {1: logs[0], 12: logs[1]}


def test_a_group_names_its_tasks_up_to_a_limit() -> None:
    tasks = [TaskId("h", str(k), "gl") for k in (0, 1, 12)]
    assert group_text(tasks) == "h/0,1,12/gl"
    assert list(tasks_from_group("h/0,1,12/gl")) == tasks
    assert tasks_from_group("h/-/reduce") == (TaskId("h", "-", "reduce"),)
    for text in ("h/0,/gl", "h/0,1", "h//gl", "h/" + ",".join(["0"] * 70) + "/gl", "h/0,1/x"):
        with pytest.raises(BadInput):
            tasks_from_group(text)
