"""The manual is current: no history outside the lab book, existing fields, how-to pages that parse."""

from __future__ import annotations

import ast
import inspect
import re
import shlex
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import pbrs_farm
from benchmarks.docs_figures import commits_named, dates_named, sentences, word_count
from benchmarks.manual_pages import manual_pages, without_code
from pbrs_farm.cli import MODULES, build_parser
from pbrs_farm.commands.arguments import recipe_of
from pbrs_farm.core.recipe import Recipe, field_paths
from pbrs_farm.scene.home import Home
from pbrs_farm.views.views import Frame
from tests.docs.fenced import PAGES, REPO, Block, blocks_of, name_of

LAB = sorted((REPO / "docs/lab").rglob("*.md"))
HOWTO = sorted(p for p in (REPO / "docs/howto").glob("*.md") if p.stem != "index")
MODULE_OF = {verb: module for module, verbs in MODULES.items() for verb in verbs}
OF_NAME = {"home": Home, "scene": Home, "lit": Home, "frame": Frame, "left": Frame, "right": Frame}


def fences(page: Path, language: str) -> list[str]:
    """The fenced blocks of a page in one language."""
    return [block.text for block in blocks_of(page) if block.language == language]


def commands(page: Path) -> Iterator[list[str]]:
    """The words of each pbrs-farm command of a page's sh blocks."""
    for block in blocks_of(page):
        for line in block.lines if block.language == "sh" else ():
            program, *words = shlex.split(line)
            if program in ("pbrs-farm", ".venv/bin/pbrs-farm"):
                yield words


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_fenced_block_has_a_mark_for_its_commands(page: Path) -> None:
    assert [f"{b.name} {fault}" for b in blocks_of(page) for fault in b.faults()] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_no_command_is_in_an_indented_block_which_no_test_runs(page: Path) -> None:
    text = without_code(page.read_text(encoding="utf-8"))
    assert re.findall(r"^    (?:\S*/)?pbrs-farm .*", text, re.MULTILINE) == []


@pytest.mark.parametrize("page", [*manual_pages(REPO), *LAB], ids=name_of)
def test_a_link_leads_to_a_page_and_to_a_heading_of_it(page: Path) -> None:
    dead = []
    for link in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text(encoding="utf-8"))):
        path, _, anchor = link.partition("#")
        to = page.parent / path if path else page
        if "://" in link or path.startswith("mailto:"):
            continue
        if not to.exists() or (anchor and to.suffix == ".md" and anchor not in anchors(to)):
            dead.append(link)
    assert dead == []


@cache
def anchors(page: Path) -> list[str]:
    """The anchors that MkDocs gives a page's headings."""
    slugs: list[str] = []
    for heading in re.findall(r"^#+ (.+)$", without_code(page.read_text(encoding="utf-8")), re.M):
        words = re.sub(r"\]\([^)]*\)", "]", heading).encode("ascii", "ignore").decode()
        slug = re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", words).strip().lower())
        slugs.append(f"{slug}_{slugs.count(slug)}" if slug in slugs else slug)
    return slugs


@pytest.mark.parametrize("page", manual_pages(REPO), ids=name_of)
def test_no_word_of_a_page_is_taken_for_html_and_so_not_shown(page: Path) -> None:
    text = re.sub(
        r"<!--.*?-->|``.*?``|`[^`]*`",
        "",
        without_code(page.read_text(encoding="utf-8")),
        flags=re.S,
    )
    assert [
        t for t in re.findall(r"</?[A-Za-z][^>\n]*>", text) if t not in ("<br>", "<sub>", "</sub>")
    ] == []


def test_a_block_without_a_mark_or_with_a_wrong_one_is_reported() -> None:
    block = Block(REPO / "README.md", 1, "sh", "pbrs-farm homes  # nine\nls\n", "")
    assert block.lines == ["pbrs-farm homes", "ls"]
    assert block.faults() == ["has no mark: see tests/docs/fenced.py"]
    assert replace(block, language="").faults() != []
    assert replace(block, mark="often").faults() == ["is marked 'often'"]
    assert replace(block, mark="run; needs data: nothing").faults() == ["no line has 'nothing'"]
    marked = replace(block, mark="run; needs browser: homes")
    assert marked.faults() == []
    assert [marked.how(line) for line in marked.lines] == ["needs browser", "run"]


@pytest.mark.parametrize("page", manual_pages(REPO), ids=name_of)
def test_a_page_outside_the_lab_book_names_no_commit_and_no_date(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert commits_named(text) == []
    assert dates_named(text) == []


@pytest.mark.parametrize("page", manual_pages(REPO), ids=name_of)
def test_every_field_named_by_a_page_exists_in_the_recipe(page: Path) -> None:
    paths = {*field_paths(), *(f"modes.{group}" for group in Recipe.model_fields)}
    groups = "|".join(set(Recipe.model_fields) - {"name", "seed"})
    text = page.read_text(encoding="utf-8")
    named = re.findall(rf"--set ((?:{groups})\.[a-z_0-9]+)=", text)
    # In a table of fields: the first cell of a row, `light.spp`, `light.noise`.
    for cell in re.findall(r"^\| ((?:`[a-z_.0-9]+`(?:, )?)+) \|", text, re.MULTILINE):
        named += [f for f in re.findall(r"`([a-z_.0-9]+)`", cell) if re.match(rf"({groups})\.", f)]
    endings = (".exr", ".png", ".json", ".py", ".jsonl")
    assert [f for f in named if f not in paths and not f.endswith(endings)] == []


def test_every_page_that_the_code_names_exists() -> None:
    for folder in ("pbrs_farm", "workers"):
        for path in (REPO / folder).rglob("*.py"):
            for page in re.findall(r"\bdocs/[a-z_/]+\.md", path.read_text(encoding="utf-8")):
                assert (REPO / page).exists(), f"{path}: {page}"


def test_readme_has_at_most_110_lines() -> None:
    assert len((REPO / "README.md").read_text(encoding="utf-8").splitlines()) <= 110


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_command_of_a_page_parses_and_its_recipe_is_valid(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "rig.toml").write_text("[[cameras]]\nname = 'front'\n")
    for words in commands(page):
        args = build_parser(MODULE_OF[words[0]]).parse_args(words)
        if hasattr(args, "recipe") and words[0] != "train":
            recipe_of(args)


@pytest.mark.parametrize("page", HOWTO, ids=name_of)
def test_every_python_block_of_a_howto_compiles_and_calls_existing_functions(page: Path) -> None:
    for block in fences(page, "python"):
        for node in ast.walk(ast.parse(block)):
            if isinstance(node, ast.Attribute):
                owner = owner_of(node.value)
                assert owner is None or hasattr(owner, node.attr), ast.unparse(node)
            if isinstance(node, ast.Call) and (callee := owner_of(node.func)) is not None:
                parameters = inspect.signature(callee).parameters
                takes_any = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
                for keyword in node.keywords:
                    assert takes_any or keyword.arg in parameters, (
                        f"{ast.unparse(node)}: {keyword.arg}"
                    )


def owner_of(node: ast.expr) -> Any:
    """The object of an expression that starts at pf or at a name of OF_NAME; else None."""
    match node:
        case ast.Name(id="pf"):
            return pbrs_farm
        case ast.Name(id=name):
            return OF_NAME.get(name)
        case ast.Attribute(value=value, attr=attr):
            owner = owner_of(value)
            return None if owner is None else getattr(owner, attr)
        case ast.Call(func=function) if (callee := owner_of(function)) is not None:
            # Calls on the result of a method that returns a home are checked, too.
            is_home = inspect.signature(callee).return_annotation == "Home"
            return Home if is_home else None
    return None


@pytest.mark.parametrize("page", HOWTO, ids=name_of)
def test_a_howto_has_a_goal_a_command_or_python_a_result_and_a_picture(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text.startswith("# ")
    assert re.search(r"^You (want|have) ", text, re.MULTILINE)
    assert re.search(r"\byou get\b", text, re.IGNORECASE)
    assert fences(page, "sh") or fences(page, "python") or "pbrs-farm " in text
    pictures = re.findall(r"^!\[.+\]\((\S+)\)$", text, re.MULTILINE)
    assert pictures
    assert [p for p in pictures if not (page.parent / p).exists()] == []
    assert f"]({page.name})" in (REPO / "docs/howto/index.md").read_text(encoding="utf-8")


def test_sentences_leave_code_tables_and_headings_out_and_links_keep_their_words() -> None:
    text = "# Head\n\nOne [two](x.md) three. Four `a b c` five!\n\n| a | b. C |\n\n```\nno. No.\n```\n- six seven\n- eight nine"
    assert list(sentences(text)) == [
        "One two three",
        "Four `a b c` five!",
        "six seven",
        "eight nine",
    ]
    assert [word_count(s) for s in sentences(text)] == [3, 3, 2, 2]


def test_a_commit_is_distinguished_from_a_number_a_house_and_a_word() -> None:
    assert commits_named("at 8fc1fcd, (45ef339)") == ["8fc1fcd", "45ef339"]
    assert commits_named("26,421,021 of 779342 by 2bedroomapartment-b68e4452/views effaced") == []
