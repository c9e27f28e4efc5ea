"""The tutorials and pages work: commands and Python run, files exist."""

from __future__ import annotations

import re
import shlex
import tomllib
from pathlib import Path

import pytest

from pbrs_farm.cli import MODULES, main
from tests.docs.fenced import REPO, blocks

PAGES = sorted((REPO / "docs").rglob("*.md"))


@pytest.mark.pages
def test_every_line_of_the_researchers_tutorial_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    n_run = 0
    for language, text in blocks("tutorials/researcher.md"):
        if language == "python":
            exec(compile(text, "researcher.md", "exec"), names)
            n_run += 1
            continue
        for line in text.splitlines():
            program, *words = shlex.split(line)
            assert program == "pbrs-farm"
            assert main(words) == 0, line
            n_run += 1
    assert n_run >= 12


@pytest.mark.pages
def test_every_block_of_the_python_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    sources = [text for language, text in blocks("python.md") if language == "python"]
    for text in sources:
        exec(compile(text, "python.md", "exec"), names)
    assert len(sources) >= 6
    assert names["pose"]
    assert len(names["frames"]) == 2  # type: ignore[arg-type]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_shows_verbs_that_exist_and_no_folder_a_clone_lacks(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    verbs_known = {verb for verbs in MODULES.values() for verb in verbs}
    for fence in re.findall(r"^```[a-z]*\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        for verb in re.findall(r"^(?:\.venv/bin/)?pbrs-farm ([a-z][a-z-]*)", fence, re.MULTILINE):
            assert verb in verbs_known, verb
    assert "../shared" not in text
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (page.parent / link).exists(), link


def test_the_packagers_table_names_the_extras_that_there_are() -> None:
    text = (REPO / "docs/tutorials/packager.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \|", text, re.MULTILINE))
    project = tomllib.loads((REPO / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert rows.keys() == extras.keys() - {
        "study-peers",
        "notebooks",
        "bench",
        "docs",
        "dev",
        "release",
    }
    for extra, cell in rows.items():
        if extra != "all":
            packages = [re.split(r"[\[>=]", words)[0] for words in extras[extra]]
            assert set(cell.split(", ")) <= {p.removesuffix("-cpu") for p in packages}


def test_every_page_is_in_the_sites_navigation() -> None:
    nav = (REPO / "mkdocs.yml").read_text(encoding="utf-8")
    for page in PAGES:
        assert f": {page.relative_to(REPO / 'docs')}" in nav, page


def test_the_sites_tabs_are_the_first_level_of_its_navigation() -> None:
    text = (REPO / "mkdocs.yml").read_text(encoding="utf-8")
    nav = text.partition("nav:\n")[2]
    tabs = ["Start", "How-to", "Homes", "Pictures", "Many machines", "Reference", "Developers", "Lab book"]  # fmt: skip
    assert re.findall(r"^  - (.+):$", nav, re.MULTILINE) == tabs
    assert "navigation.tabs" in text
