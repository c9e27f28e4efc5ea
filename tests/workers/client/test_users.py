"""A farm with users: identity, permissions, and the log line of each order."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.store.secret import Secret
from workers.client.farm_client import Farm, new_spec
from workers.client.users import add_user, change_user, remove_user, user_rows
from workers.config import FarmConfig
from workers.job import HouseEntry


@pytest.fixture
def farm(config: FarmConfig, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Farm:
    monkeypatch.setenv("PBRS_TEST_CONTROL", str(tmp_path))
    return Farm(replace(config, runner="tests.workers.fake_runner:runner"))


def with_token(farm: Farm, token: str) -> Farm:
    return Farm(replace(farm.config, token=Secret(token)))


def submit(farm: Farm, house: str = "h0", **fields: object) -> str:
    spec = new_spec(recipe_from_name("preview"), **fields)
    return farm.submit([HouseEntry(house_id=house, source="{}")], spec).job_id


@pytest.fixture
def team(farm: Farm) -> dict[str, Farm]:
    """The farm as seen by its admin, two users and a stranger."""
    farms = {"root": with_token(farm, add_user(farm, "root", {}))}
    for name in ("ann", "bob"):
        farms[name] = with_token(farm, add_user(farms["root"], name, {}))
    return farms | {"nobody": farm, "stranger": with_token(farm, "x" * 32)}


def test_a_user_steers_his_jobs_an_admin_all_and_each_order_is_logged(
    team: dict[str, Farm],
) -> None:
    job = submit(team["ann"])
    assert team["nobody"].view(job).user == "ann"
    with pytest.raises(BadInput, match="is a job of ann"):
        team["bob"].pause(job)
    for who, text in (("nobody", "needs a user's token"), ("stranger", "is not a user's token")):
        with pytest.raises(BadInput, match=text):
            team[who].cancel(job)
        with pytest.raises(BadInput, match=text):
            submit(team[who], "h1")
    assert team["ann"].pause(job) == "paused"
    assert team["root"].resume(job) == "running"
    with pytest.raises(BadInput, match="only an admin may"):
        team["ann"].drain("w1")
    lines = team["nobody"].users.changes(9)
    orders = [(row["user"], row["what"]) for row in lines if row["of"] == job]
    assert orders == [("root", "resume"), ("ann", "pause"), ("ann", "submit")]


def test_who_may_not_submits_no_urgent_job(team: dict[str, Farm]) -> None:
    with pytest.raises(BadInput, match="may not submit urgent jobs"):
        submit(team["ann"], preempt=True)
    change_user(team["root"], "ann", {"may_preempt": True})
    assert team["ann"].view(submit(team["ann"], preempt=True)).is_urgent


def test_users_outlive_a_redis_that_lost_them_and_one_admin_stays(team: dict[str, Farm]) -> None:
    root, job = team["root"], submit(team["ann"])
    root.ledger.client.delete(f"{root.config.prefix}users")
    assert root.recover(job).user == "ann"
    assert sorted(root.users.all()) == ["ann", "bob", "root"]
    for change in (
        lambda: remove_user(root, "root"),
        lambda: change_user(root, "root", {"is_admin": False}),
    ):
        with pytest.raises(BadInput, match="this is the last admin"):
            change()
    remove_user(root, "bob")
    with pytest.raises(BadInput, match="is not a user's token"):
        team["bob"].pause(job)
    assert [row["user"] for row in user_rows(root)] == ["ann", "root"]


def test_the_verb_prints_a_token_once_and_refuses_invalid_quotas(
    farm: Farm, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PBRS_REDIS_URL", farm.config.redis_url.reveal())
    monkeypatch.setenv("PBRS_STORE", farm.config.store_url)
    monkeypatch.setenv("PBRS_FARM_PREFIX", farm.config.prefix)
    assert main(["users"]) == 0
    assert "checks no tokens" in capsys.readouterr().out
    assert main(["users", "add", "root"]) == 0
    match = re.fullmatch(r"root's token, not stored: (\S{32})\n", capsys.readouterr().out)
    assert match is not None
    monkeypatch.setenv("PBRS_TOKEN", match[1])
    assert main(["users", "add", "ann", "--share", "2", "--slot-hours", "9"]) == 0
    for words in (["add", "Ann B"], ["add", "ann"], ["limit", "ann"], ["limit", "bo", "--share", "0"],
                  ["limit", "ann", "--slot-hours", "nan"], ["remove", "an"], ["add"]):  # fmt: skip
        assert main(["users", *words]) == 1
    assert capsys.readouterr().err.count("\n") == 7
    assert main(["users", "--json"]) == 0
    text = capsys.readouterr().out
    assert '"slot_hours": 9.0' in text
    assert match[1] not in text
    assert main(["audit"]) == 0
    assert "users add" in capsys.readouterr().out
    stored = farm.store.get("jobs/users.json").decode()
    assert match[1] not in stored
