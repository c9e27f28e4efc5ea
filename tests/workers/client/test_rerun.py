"""A task that failed on the farm is repeated in the foreground, where its error is visible."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from tests.inputs.submitted_jobs import environment, fail, farm, submit
from workers.client.farm_client import Farm
from workers.client.rerun import rerun

__all__ = ["farm"]  # a fixture


def test_a_failed_task_is_repeated_by_the_command_that_failures_shows(
    farm: Farm, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    environment(farm, monkeypatch)
    monkeypatch.setenv("PBRS_FARM_RUNNER", farm.config.runner)
    d = submit(farm)
    for task in d.dispatch():
        d.run(task)
    task = d.dispatch()[0]
    house = task.partition("/")[0]
    fail(d, task)
    (tmp_path / f"data.{house}").touch()
    (kind,) = farm.failures(d.job.job_id)
    program, *words = shlex.split(kind["command"])
    assert (program, words[:2]) == ("pbrs-farm", ["rerun", task])
    # The same error in this process; after the fix, the same files as a worker's.
    assert main(words) == 1
    assert "two walls in one place" in capsys.readouterr().err
    (tmp_path / f"data.{house}").unlink()
    assert main(words) == 0
    output = capsys.readouterr()
    assert "rerun: truth" in output.err
    assert f"{task} done" in output.out
    assert any(key.endswith("truth.png") for key in farm.store.list(f"houses/{house}/"))
    # Only `retry` updates the ledger.
    assert farm.view(d.job.job_id).n_failed == 1


def test_geometry_gets_the_submitted_house_and_an_unknown_task_is_refused(farm: Farm) -> None:
    d = submit(farm)
    steps: list[str] = []
    with pytest.raises(BadInput, match=r"not admitted|no such"):
        rerun(farm, d.job.job_id, "nobody/-/geometry", steps.append)
    d.dispatch()
    rerun(farm, d.job.job_id, "h0/-/geometry", steps.append)
    assert steps == ["house None", "cameras None"]
    with pytest.raises(BadInput, match="no such task"):
        rerun(farm, d.job.job_id, "h0/7/gl", steps.append)
