"""Files of deploy/cloud: their commands parse, and the farm reads their variables."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from pbrs_farm import settings
from pbrs_farm.cli import build_parser
from workers import config
from workers.config import FarmConfig

CLOUD = Path(__file__).parents[2] / "deploy/cloud"
BATCH = json.loads((CLOUD / "batch/register-job-definition.json").read_text("utf-8"))[
    "containerProperties"
]
SKY = yaml.safe_load((CLOUD / "skypilot.yaml").read_text("utf-8"))
OPENJD = yaml.safe_load((CLOUD / "openjd.yaml").read_text("utf-8"))


def _filled(words: list[Any]) -> list[str]:
    """Arguments of a template with 1 in place of numbers and a name in place of texts."""
    values = {"Task.Param.Shard": "1", "Param.Shards": "2"}
    return [re.sub(r"\{\{(.*?)\}\}", lambda m: values.get(m[1], "x"), str(word)) for word in words]


COMMANDS = {
    "batch": BATCH["command"],
    "skypilot": re.findall(r"pbrs-farm (.*)", SKY["run"])[0].split(),
    **{
        step["name"]: _filled(step["script"]["actions"]["onRun"]["args"])
        for step in OPENJD["steps"]
    },
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_parses(name: str) -> None:
    words = COMMANDS[name]
    args = build_parser().parse_args(words)
    assert callable(args.handler)
    if "worker" in words:
        assert args.until_idle == 600


def test_variables_are_read_by_the_farm() -> None:
    fields = {f"PBRS_FARM_{name.upper()}" for name in FarmConfig.__dataclass_fields__}
    texts = [Path(module.__file__ or "").read_text("utf-8") for module in (settings, config)]
    read_names = fields | {name for text in texts for name in re.findall(r"PBRS_[A-Z0-9_]+", text)}
    for place in ("environment", "secrets"):
        assert {row["name"] for row in BATCH[place]} <= read_names
    assert {*SKY["envs"], *SKY["secrets"]} <= read_names
    assert not [name for name in SKY["secrets"].values() if name is not None]


def test_every_instance_leaves_in_the_time_it_is_given() -> None:
    # ECS kills a container 30 s after its stop signal.
    environment = {row["name"]: row["value"] for row in BATCH["environment"]}
    assert float(environment["PBRS_FARM_GRACE_S"]) < 30
