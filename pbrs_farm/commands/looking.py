"""Verbs that describe the program and the machine; effects: print; skies downloads, cache deletes."""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import sys
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from pbrs_farm.commands.arguments import Verb, echo, echo_json
from pbrs_farm.commands.completion_scripts import completion_script
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import RECIPE_NAMES, Recipe, recipe_from_name
from pbrs_farm.core.shown_text import did_you_mean

if TYPE_CHECKING:
    from pbrs_farm.doctor import Finding


def add_verbs(verb: Verb) -> None:
    """Add doctor, help, cache, inputs, skies, recipes, layers and completion."""
    p = verb("doctor", _doctor)
    p.add_argument("--store", default=os.environ.get("PBRS_STORE", ""), help="store to check")
    p.add_argument("--redis", default=os.environ.get("PBRS_REDIS_URL", ""), help="Redis to check")
    p = verb("recipes", _recipes)
    p.add_argument("name", nargs="?", default="fast", choices=RECIPE_NAMES, help="default fast")
    for name, handler in (
        ("help", _help),
        ("cache", _cache),
        ("inputs", _inputs),
        ("skies", _skies),
        ("layers", _layers),
        ("completion", _completion),
    ):
        verb(name, handler)


def _doctor(args: argparse.Namespace) -> int:
    from pbrs_farm.doctor import can_run, examine

    findings = examine(args.store, args.redis)
    fine = can_run(findings)
    if args.json:
        echo_json({"can_run": fine, "findings": [asdict(f) for f in findings]})
        return 0 if fine else 1
    for f in findings:
        # One line per part, with a remedy if it is not ok.
        mark = "MISSING" if f.state == "missing" else f.state
        echo(f"{mark:<8}  {f.part:<20} {f.text}")
        if f.state != "ok" and f.remedy:
            echo(f"{'':<32}-> {f.remedy}")
        if f.gives:
            echo(f"{'':<32}   gives {f.gives}")
    echo()
    echo(_verdict(findings, is_fine=fine))
    return 0 if fine else 1


def _verdict(findings: Sequence[Finding], *, is_fine: bool) -> str:
    """A sentence on the machine's abilities, given these findings."""
    from pbrs_farm.doctor import GL

    if not is_fine:
        return "This machine cannot render yet: see MISSING above."
    if any(f.part == GL and f.state != "ok" for f in findings):
        return f"This machine can render by path tracing; pictures of OpenGL are skipped. See {GL} above."
    return "This machine can render."


def _help(args: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.markdown import Markdown

    pages = _pages()
    word = args.page.removesuffix(".md")
    exact = [name for name in pages if word in (name, name.rpartition("/")[2])]
    if exact:
        console = Console()
        with console.pager(styles=True) if console.is_terminal else nullcontext():
            console.print(Markdown(pages[exact[0]]))
        return 0
    hits = {name: text.lower().count(word.lower()) for name, text in pages.items()}
    names = [name for name in pages if hits[name]] if word else list(pages)
    if not names:
        raise BadInput("help", "", f"no page has {word!r}", hint=did_you_mean(word, pages))
    for name in sorted(names, key=lambda name: -hits[name]) if word else names:
        title = next((x for x in pages[name].splitlines() if x.startswith("# ")), "")
        echo(f"{name:<24} {title.removeprefix('# ')}")
    return 0


def _pages() -> dict[str, str]:
    """Name of a page of the manual, such as howto/walk -> its Markdown; without api/, made of docstrings."""
    package = Path(__file__).parents[1]
    folder = package / "pages" if (package / "pages").is_dir() else package.parent / "docs"
    paths = [p for p in sorted(folder.rglob("*.md")) if p.parent.name != "api"]
    texts = {p.relative_to(folder).with_suffix("").as_posix(): p.read_text("utf-8") for p in paths}
    return {
        name: re.sub(r"<!--.*?-->\n?", "", text, flags=re.DOTALL) for name, text in texts.items()
    }


def _cache(args: argparse.Namespace) -> None:
    from pbrs_farm.assets.debian import cache_folder
    from pbrs_farm.operating_system import kernel_cache

    entries = {p.name: p for p in sorted(cache_folder().glob("*"))}
    entries["kernels"] = kernel_cache()
    unknown = next((name for name in args.clear or () if name not in entries), None)
    if unknown is not None:
        raise BadInput("--clear", "", f"no entry {unknown!r}", hint=did_you_mean(unknown, entries))
    total = 0
    for name, path in entries.items():
        files = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
        size = sum(p.stat().st_size for p in files if p.exists())
        is_cleared = args.clear is not None and (name in args.clear or not args.clear)
        if is_cleared:
            shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(
                missing_ok=True
            )
        total += size
        echo(f"{size / 1e6:9.1f} MB  {name}{'  deleted' if is_cleared else ''}")
    echo(
        f"{total / 1e6:9.1f} MB  in {cache_folder()} and {kernel_cache()}; all is fetched or made again when needed"
    )


def _inputs(args: argparse.Namespace) -> None:
    from pbrs_farm.prepare.formats import formats, formats_of_plugins, missing_library

    rows = [*formats(), *formats_of_plugins()]
    shown = ("kind", "title", "files", "brings", "needs", "where", "licence")
    if args.json:
        echo_json([{name: getattr(row, name) for name in shown} for row in rows])
        return
    for row in rows:
        echo(f"{row.title}: {row.files}")
        echo(f"    brings    {row.brings}")
        if row.needs:
            command = missing_library(row)
            echo(
                f"    needs     {row.needs}{f', not installed here: {command}' if command else ''}"
            )
        echo(f"    from      {row.where}; {row.licence}")


def _skies(_args: argparse.Namespace) -> None:
    from pbrs_farm.assets.skies import fetch_skies

    folder = fetch_skies()
    for path in sorted(folder.glob("*.exr")):
        echo(str(path))
    echo(f"use them with: --set sky.kind=panorama --set sky.panoramas={folder}")


def _recipes(args: argparse.Namespace) -> None:
    recipe = recipe_from_name(args.name)
    if args.toml:
        from pbrs_farm.formats.recipe_toml import toml_from_recipe

        echo(toml_from_recipe(recipe))
        return
    echo(f"# recipe {args.name}; --set group.field=value overrides any field")
    # Print the recipe as --set takes it, group by group.
    for group, info in Recipe.model_fields.items():
        value = getattr(recipe, group)
        # Top-level fields of the recipe, like the seed, have no group.
        if not hasattr(type(value), "model_fields"):
            echo(f"{group} = {json.dumps(value)}")
            continue
        echo(f"\n# {info.annotation.__doc__ if info.annotation else ''}")
        for name, field in type(value).model_fields.items():
            text = f"{group}.{name} = {json.dumps(getattr(value, name))}"
            echo(f"{text:<48} # {field.description}" if field.description else text)


def _layers(_args: argparse.Namespace) -> None:
    from pbrs_farm.core.layers import layer_table, text_table

    echo(text_table(shutil.get_terminal_size().columns) if sys.stdout.isatty() else layer_table())


def _completion(args: argparse.Namespace) -> None:
    echo(completion_script(args.shell, args.every_verb().verbs()))
