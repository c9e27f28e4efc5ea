"""Tasks of a render process, run in this process."""

from pathlib import Path

import pytest

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run import run_task
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.processes.messages import Message
from pbrs_farm.run.processes.render_task import RenderTask, Setting


def test_memory_is_given_back_after_each_step_of_a_house(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[str] = []
    monkeypatch.setattr(run_task, "give_back_memory", lambda: lines.append("given back"))
    setting = Setting(
        str(tmp_path), recipe_from_name("preview", {}), 1, runner="tests.run.fakes:run_step"
    )
    source = resolve("builtin")

    def hear(message: Message) -> None:
        lines.append(f"{message.kind} {message.body.get('step', message.text)}")

    task = RenderTask(source.house_id, ("house", "cameras"), source)
    run_task.run_task(hear, setting, HouseCache(), task)
    assert lines == [
        "step house",
        "given back",
        "event house",
        "step cameras",
        "given back",
        "event cameras",
    ]
