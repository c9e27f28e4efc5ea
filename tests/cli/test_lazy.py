"""A command imports the module of its own verb only, and the farm's verbs look without heavy packages."""

from __future__ import annotations

import argparse
import subprocess
import sys

import pytest

from pbrs_farm.cli import MODULES, build_parser

HEAVY = "mitsuba drjit moderngl OpenImageIO celery kombu numpy scipy pydantic obstore"


def verbs_of(parser: argparse.ArgumentParser) -> list[str]:
    (action,) = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    return list(action.choices)


@pytest.mark.parametrize("module", MODULES)
def test_the_table_names_the_verbs_each_module_adds(module: str) -> None:
    assert verbs_of(build_parser(module)) == list(MODULES[module])


def test_the_help_names_every_verb() -> None:
    every = [verb for verbs in MODULES.values() for verb in verbs]
    assert verbs_of(build_parser()) == every
    text = build_parser().format_help()
    assert all(f"\n  {verb}" in text for verb in every)


def test_the_help_says_what_the_farms_verbs_need(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pbrs_farm.cli._has_farm", lambda: False)
    text = " ".join(build_parser().format_help().split())
    assert "the other verbs of a farm need celery and redis: " in text
    assert "[workers]" in text


@pytest.mark.parametrize("words", ["status", "why h/0/gl", "pause", "workers"])
def test_the_farms_small_verbs_import_nothing_heavy(words: str) -> None:
    code = f"""
import sys
from pbrs_farm.cli import main
code = main({words.split()!r})
print(code, sorted(set({HEAVY.split()!r}) & set(sys.modules)))
"""
    env = {"PBRS_REDIS_URL": "redis://127.0.0.1:1/0", "PBRS_STORE": "memory:"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False
    )
    assert "no Redis at" in done.stderr
    assert done.stdout.strip() == "1 []"
