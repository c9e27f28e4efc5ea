"""Files and modules named in docstrings, comments and pages exist."""

from __future__ import annotations

import ast
import io
import re
import subprocess
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from pbrs_farm.core.plugins import GROUPS
from tests.docs.fenced import DEPLOY_PAGES, blocks_of

REPO = Path(__file__).parents[2]
CODE = ("pbrs_farm", "workers", "tests", "benchmarks", "scripts", "examples")
SOURCES = sorted(p for folder in CODE for p in (REPO / folder).rglob("*.py"))
# The lab book and the changelog describe the past; a tutorial may name a file that its reader
# writes.
PAGES = [
    p
    for p in (*REPO.glob("*.md"), *(REPO / "docs").rglob("*.md"), *DEPLOY_PAGES)
    if "lab" not in p.parts and p.name != "CHANGELOG.md"
]
# A file: folders and a name with an ending of the repository; a module: a dotted name.
_FILE = re.compile(r"(?<![\w./*<>{}-])((?:[\w-]+/)*\w+\.(?:py|lua|sh))\b(?![.\w(=])")
_MODULE = re.compile(r"(?<![\w./-])((?:pbrs_farm|workers|tests|benchmarks)(?:\.\w+)+)")
# A user's files, and the groups of entry points (core/plugins.py), which look like modules.
OTHERS = {"page.py", *(f"pbrs_farm.{kind}" for kind in GROUPS)}


def texts_of(source: Path) -> Iterator[str]:
    """The docstrings and comments of a module."""
    text = source.read_text(encoding="utf-8")
    lines = [s for s in text.splitlines() if not s.startswith(("from ", "import "))]
    if not any(_FILE.search(line) or _MODULE.search(line) for line in lines):
        return  # parsing all files takes ten seconds
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield str(node.value.value)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.string


@cache
def files() -> frozenset[str]:
    """Every file of the repository, and every suffix of its path."""
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    listed = subprocess.run(command, cwd=REPO, capture_output=True, text=True, check=True)
    ends = set()
    for line in listed.stdout.splitlines():
        if (REPO / line).exists():
            parts = line.split("/")
            ends |= {"/".join(parts[k:]) for k in range(len(parts))}
    return frozenset(ends)


def is_module(name: str) -> bool:
    """True if a dotted name is a package, a module, or a name in one."""
    parts = name.split(".")
    for k in range(len(parts), 0, -1):
        place = REPO.joinpath(*parts[:k])
        module = (
            place.with_suffix(".py") if place.with_suffix(".py").exists() else place / "__init__.py"
        )
        if place.is_dir() and k == len(parts):
            return True
        if module.exists():
            return k == len(parts) or re.search(rf"\b{parts[k]}\b", module.read_text()) is not None
    return False


def missing(text: str) -> list[str]:
    """The files and modules that a text names and that do not exist."""
    named = [f for f in _FILE.findall(text) if f not in files() and f not in OTHERS]
    return named + [m for m in _MODULE.findall(text) if m not in OTHERS and not is_module(m)]


def without_excerpts(page: Path) -> str:
    """A page's text without examples of code that a reader is to write."""
    text = page.read_text(encoding="utf-8")
    for block in blocks_of(page):
        if block.how() == "excerpt":
            for line in block.text.splitlines():
                text = text.replace(line, "") if line.strip() else text
    return text


@pytest.mark.parametrize("folder", CODE)
def test_docstrings_and_comments_name_files_and_modules_that_exist(folder: str) -> None:
    dead = {
        f"{source.relative_to(REPO)}: {name}"
        for source in SOURCES
        if source.relative_to(REPO).parts[0] == folder
        for text in texts_of(source)
        for name in missing(text)
    }
    assert dead == set()


def test_pages_name_files_and_modules_that_exist() -> None:
    dead = {
        f"{page.relative_to(REPO)}: {name}"
        for page in PAGES
        for name in missing(without_excerpts(page))
    }
    assert dead == set()


def test_a_name_that_is_gone_is_found() -> None:
    text = "As core/house.py has it, see dress/never_was.py, pbrs_farm.core.house.House and workers.gone.x"
    assert missing(text) == ["dress/never_was.py", "workers.gone.x"]
