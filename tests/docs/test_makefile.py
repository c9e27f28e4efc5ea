"""Every target of the Makefile is valid shell, for every NAME in the pages."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from benchmarks.__main__ import BENCHES
from tests.docs.fenced import DEPLOY_PAGES

REPO = Path(__file__).parents[2]
MAKEFILE = (REPO / "Makefile").read_text(encoding="utf-8")
TARGETS = re.findall(r"^([a-z][a-z0-9-]*):.*##", MAKEFILE, re.MULTILINE)
PAGES = [
    *sorted(REPO.glob("*.md")), *sorted((REPO / "docs").rglob("*.md")), *DEPLOY_PAGES,
    REPO / "tests/infra/README.md",
]  # fmt: skip


def commands_of(target: str, *variables: str) -> list[str]:
    """The commands that make would run, without running them."""
    done = subprocess.run(
        ["make", "-n", "--no-print-directory", target, *variables],
        cwd=REPO, capture_output=True, text=True, check=True,
    )  # fmt: skip
    return done.stdout.replace("\\\n", " ").splitlines()


def named_in_pages() -> Iterator[tuple[str, str]]:
    """(target, its NAME or "") of each `make ...` in the pages' code."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for code in re.findall(r"^```.*?^```|`[^`\n]+`", text, re.MULTILINE | re.DOTALL):
            for words in re.findall(r"(?:^|[`\s])(?<!pbrs-farm )make ([a-z][^`#\n]*)", code):
                name = re.search(r"\bNAME=(\w+)", words)
                for word in words.split():
                    if "=" not in word:
                        yield word, name[1] if name else ""


@pytest.mark.parametrize(
    ("target", "name"), [*((t, "") for t in TARGETS), *(("bench", n) for n in BENCHES)]
)
def test_a_target_is_commands_that_a_shell_can_read(target: str, name: str) -> None:
    commands = commands_of(target, f"NAME={name}")
    assert commands
    for command in commands:
        done = subprocess.run(["bash", "-n", "-c", command], capture_output=True, text=True)
        assert done.returncode == 0, f"{command}\n{done.stderr}"


def test_a_bench_installs_only_its_requirements() -> None:
    assert [c for c in commands_of("bench", "NAME=") if "pip" in c] == []
    for name, extra in (("docs", "docs"), ("release", "release"), ("light", "bench")):
        (install,) = [c for c in commands_of("bench", f"NAME={name}") if "pip install" in c]
        assert install.endswith(f'-e ".[{extra}]"')


def test_make_n_starts_nothing() -> None:
    recipes = "\n".join(re.findall(r"^\t.*", MAKEFILE, re.MULTILINE))
    assert "$(MAKE)" not in recipes
    assert "${MAKE}" not in recipes
    assert not re.search(r"^\t[@-]*\+", recipes, re.MULTILINE)
    assert "$(shell" not in MAKEFILE


def test_every_target_and_bench_that_a_page_names_exists() -> None:
    named = {(t, n) for t, n in named_in_pages()}
    assert len(named) > 30
    assert {t for t, _n in named} - {*TARGETS} == set()
    assert {n for t, n in named if t == "bench"} - {*BENCHES, ""} == set()


def test_clean_leaves_nothing_that_was_made_but_the_environment() -> None:
    (command,) = commands_of("clean")
    ignored = (REPO / ".gitignore").read_text(encoding="utf-8").split()
    folders = {name.strip("/") for name in ignored if name.endswith("/")}
    exceptions = {"__pycache__", "*.egg-info", "homes"}
    assert folders - exceptions <= {*command.split()}


def test_docs_hears_the_warnings_at_which_strict_ends() -> None:
    # --quiet drops warnings before --strict counts them: a dead link would pass.
    (line,) = re.findall(r"^\t.*mkdocs build.*", MAKEFILE, re.MULTILINE)
    assert "--strict" in line
    assert "--quiet" not in line
