"""A command imports only its verb's module, and the farm's read-only verbs no heavy packages."""

from __future__ import annotations

import argparse
import csv
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib import resources
from typing import Any

import pytest

from pbrs_farm.cli import MODULES, build_parser, first_screen
from pbrs_farm.commands.command_line import VERBS
from pbrs_farm.commands.completion_scripts import SHELLS
from pbrs_farm.study.training_plan import TASKS
from workers.ids import LEAST_URGENT

HEAVY = "mitsuba drjit moderngl OpenImageIO celery kombu numpy scipy pydantic obstore"


def verbs_of(parser: argparse.ArgumentParser) -> list[str]:
    (action,) = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    return list(action.choices)


@pytest.mark.parametrize("module", MODULES)
def test_the_table_names_the_verbs_each_module_adds(module: str) -> None:
    assert sorted(verbs_of(build_parser(module))) == sorted(MODULES[module])


def test_choices_in_the_table_of_arguments_are_those_of_the_code() -> None:
    verbs = build_parser().verbs()

    def choices(verb: str, option: str) -> list[Any]:
        (action,) = [a for a in verbs[verb]._actions if a.dest == option]
        return list(action.choices or ())

    for verb in ("train", "evaluate", "predict", "ablation"):
        assert choices(verb, "task") == list(TASKS)
    assert choices("completion", "shell") == list(SHELLS)
    assert choices("priority", "number") == list(range(LEAST_URGENT + 1))


def test_each_row_of_the_table_of_arguments_is_of_a_verb() -> None:
    lines = (resources.files("pbrs_farm.commands") / "arguments.csv").read_text("utf-8")
    rows = list(csv.reader(lines.splitlines()[2:]))
    named = {verb for row in rows for verb in row[0].split()}
    assert named <= {*VERBS, "homes:make"}


def test_the_help_names_every_verb() -> None:
    assert sorted(verbs_of(build_parser())) == sorted(VERBS)
    text = build_parser().format_help()
    assert all(f"\n  {verb}" in text for verb in VERBS)
    # The first screen lists the verbs without importing their modules.
    assert first_screen().format_help() == text


def test_the_first_screen_and_the_package_import_nothing_heavy() -> None:
    code = f"""
import sys
import pbrs_farm
after_import = set(sys.modules)
from pbrs_farm.cli import main
try:
    main(["--help"])
except SystemExit:
    pass
heavy = set({HEAVY.split()!r}) | {{"urllib.request", "importlib.metadata"}}
print("last:", sorted(heavy & set(sys.modules)), "pathlib" in after_import)
"""
    # Without modules that the interpreter loads for this environment (-S: no site).
    words = [sys.executable, "-S", "-c", f"import sys; sys.path[:0] = {sys.path!r}" + code]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "last: [] False"


def test_the_help_names_the_requirements_of_the_farms_verbs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("pbrs_farm.cli.has_farm", lambda: False)
    text = " ".join(build_parser().format_help().split())
    assert "the other commands of a farm need celery and redis: " in text
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


def test_recipes_and_jobs_import_no_scipy() -> None:
    # Each process of a farm would load it and keep it in memory, including the coordinator.
    code = "import sys, pbrs_farm.core.recipe, workers.job; print('scipy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def parsers(parser: argparse.ArgumentParser, name: str) -> Iterator[tuple[str, Any]]:
    """A parser and all its subparsers, by the words that lead to them."""
    yield name, parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for word, below in action.choices.items():
                yield from parsers(below, f"{name} {word}")


EVERY = dict(parsers(build_parser(), "pbrs-farm"))


@pytest.mark.parametrize("name", EVERY)
def test_a_verb_has_a_help_and_a_usage_and_a_word_for_every_option(name: str) -> None:
    parser = EVERY[name]
    assert parser.format_help().startswith(f"usage: {name}")
    assert parser.format_usage().startswith(f"usage: {name}")
    for action in parser._actions:
        if not isinstance(action, argparse._SubParsersAction):
            assert action.help, f"{name} {action.option_strings or action.dest}"


@pytest.mark.parametrize("verb", VERBS)
def test_the_help_of_a_verb_ends_with_examples_that_parse(verb: str) -> None:
    examples = VERBS[verb].examples.split("; ")
    assert EVERY[f"pbrs-farm {verb}"].format_help().endswith(f"\n  pbrs-farm {examples[-1]}\n")
    for example in examples:
        words = shlex.split(example.partition(" > ")[0])
        assert words[0] == verb
        assert not build_parser(VERBS[verb].module, words).parse_known_args(words)[1], example


@pytest.mark.parametrize(
    "name", [n for n, p in EVERY.items() if any(a.required and a.nargs != "*" for a in p._actions)]
)
def test_a_verb_without_its_arguments_names_them(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        EVERY[name].parse_args([])
    assert ended.value.code == 2
    assert "the following arguments are required" in capsys.readouterr().err
