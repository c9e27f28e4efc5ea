"""Files for a hosting site and a contributor's machine: workflow, issue forms and hooks name existing targets."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

REPO = Path(__file__).parents[2]
WORKFLOWS = sorted((REPO / ".github/workflows").glob("*.yml"))
FORMS = sorted((REPO / ".github/ISSUE_TEMPLATE").glob("*.yml"))


def loaded(path: Path) -> Any:
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def test_ci_runs_one_script_on_every_supported_python() -> None:
    job = loaded(REPO / ".github/workflows/ci.yml")["jobs"]["test"]
    project = tomllib.loads((REPO / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pythons = [c.rpartition(" ")[2] for c in project["classifiers"] if ":: Python :: 3." in c]
    assert job["strategy"]["matrix"]["python"] == pythons
    assert [step["run"] for step in job["steps"] if "run" in step][-1] == ".ci/run"
    assert (REPO / ".ci/run").exists()


def test_ci_tries_a_view_and_its_resumption_on_other_systems() -> None:
    job = loaded(REPO / ".github/workflows/ci.yml")["jobs"]["systems"]
    assert [system.partition("-")[0] for system in job["strategy"]["matrix"]["system"]] == [
        "macos", "windows",
    ]  # fmt: skip
    run = job["steps"][-1]["run"]
    for words in ("pbrs-farm demo", "0 steps done", "pbrs-farm verify"):
        assert words in run


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda p: p.stem)
def test_a_workflow_makes_targets_that_there_are(path: Path) -> None:
    targets = re.findall(r"run: make ([a-z-]+)", path.read_text(encoding="utf-8"))
    makefile = (REPO / "Makefile").read_text(encoding="utf-8")
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda p: p.stem)
def test_a_workflow_names_actions_by_the_digest_of_a_commit(path: Path) -> None:
    for action in re.findall(r"uses: (.*)", path.read_text(encoding="utf-8")):
        assert re.fullmatch(r"[\w/-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action), action


@pytest.mark.parametrize("path", [f for f in FORMS if f.stem != "config"], ids=lambda p: p.stem)
def test_an_issue_form_has_the_fields_that_the_site_requires(path: Path) -> None:
    form = loaded(path)
    assert {"name", "description", "body"} <= form.keys()
    names = [field["id"] for field in form["body"]]
    assert len(names) == len(set(names))
    assert all(field["attributes"]["label"] for field in form["body"])


def test_hooks_run_the_commands_of_make_check() -> None:
    (repo,) = loaded(REPO / ".pre-commit-config.yaml")["repos"]
    hooks = " ".join(hook["entry"] for hook in repo["hooks"])
    check = (REPO / "Makefile").read_text(encoding="utf-8").partition("\ncheck:")[2]
    for program in re.findall(r"^\t\$\(BIN\)/([a-z-]+)", check.partition("\n\n")[0], re.MULTILINE):
        assert f".venv/bin/{program}" in hooks, program


def test_no_modules_import_each_other_at_run_time() -> None:
    from benchmarks.house import import_cycles, imports_of_modules

    assert import_cycles(imports_of_modules()) == 0
