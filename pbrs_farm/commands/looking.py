"""Verbs that tell: doctor, inputs, skies, recipes, layers, completion. Effects: print; skies downloads."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import shutil
import sys
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Final

from pbrs_farm.commands.arguments import Verb, echo, echo_json
from pbrs_farm.core.recipe import RECIPE_NAMES, Recipe, recipe_from_name

# Scripts by which bash, zsh and fish complete verbs, options and their choices; pure.


SHELLS: Final = ("bash", "zsh", "fish")

# Words that argparse does not know as choices: example homes where homes are named, recipes.
_HOME_VERBS: Final = ("run", "dress", "repair", "cameras", "submit")

_BASH: Final = """\
_pbrs_farm() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD-1]}} verb= w
  for w in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    case $w in {verbs_pattern}) verb=$w; break ;; esac
  done
  COMPREPLY=()
  case $verb:$before in
{choices}
  esac
  case $verb in
{words}
  esac
}}
complete -o default -F _pbrs_farm pbrs-farm"""


def completion_script(shell: str, verbs: Mapping[str, argparse.ArgumentParser]) -> str:
    """What the shell reads to complete the command's words; verbs: each with its parser."""
    if shell == "fish":
        return "\n".join(_fish_lines(verbs))
    script = _bash_script(verbs)
    if shell == "bash":
        return script
    return "autoload -U +X bashcompinit && bashcompinit\n" + script


def _bash_script(verbs: Mapping[str, argparse.ArgumentParser]) -> str:
    choices, words = [], [_bash_case("''", list(verbs))]
    for verb, parser in verbs.items():
        for option, values in _option_choices(parser):
            choices.append(_bash_case(f"{verb}:{option}", values, "return"))
        words.append(_bash_case(verb, [*_options(parser), *_arguments(verb, parser)]))
    return _BASH.format(
        verbs_pattern="|".join(verbs), choices="\n".join(choices), words="\n".join(words)
    )


def _bash_case(pattern: str, words: list[str], then: str = "") -> str:
    # compgen keeps the words that begin with what is typed.
    reply = f'COMPREPLY=($(compgen -W {shlex.quote(" ".join(words))} -- "$word"))'
    return f"    {pattern}) {reply}{f'; {then}' if then else ''} ;;"


def _fish_lines(verbs: Mapping[str, argparse.ArgumentParser]) -> Iterator[str]:
    start = "complete -c pbrs-farm"
    for verb, parser in verbs.items():
        text = shlex.quote((parser.description or "").split(";")[0])
        yield f"{start} -f -n __fish_use_subcommand -a {verb} -d {text}"
        of_verb = f"{start} -n '__fish_seen_subcommand_from {verb}'"
        values = dict(_option_choices(parser))
        for option in _options(parser):
            # -x: nothing but these words may follow the option, no file names.
            known = f" -x -a {shlex.quote(' '.join(values[option]))}" if option in values else ""
            yield f"{of_verb} -l {option.removeprefix('--')}{known}"
        if arguments := _arguments(verb, parser):
            yield f"{of_verb} -a {shlex.quote(' '.join(arguments))}"


def _options(parser: argparse.ArgumentParser) -> list[str]:
    return sorted(name for name in parser._option_string_actions if name.startswith("--"))


def _option_choices(parser: argparse.ArgumentParser) -> Iterator[tuple[str, list[str]]]:
    """Each option that takes one of some words, with those words."""
    from pbrs_farm.core.layers import OPTIONAL
    from pbrs_farm.core.lighting import ALL_MODES
    from pbrs_farm.core.recipe import RECIPE_NAMES

    # Options that take lists declare no choices of their own.
    known = {
        "--recipe": list(RECIPE_NAMES),
        "--modes": [mode.value for mode in ALL_MODES],
        "--layers": list(OPTIONAL),
    }
    for name, action in parser._option_string_actions.items():
        if action.choices and name.startswith("--"):
            yield name, [str(choice) for choice in action.choices]
        elif name in known:
            yield name, known[name]


def _arguments(verb: str, parser: argparse.ArgumentParser) -> list[str]:
    """The words a verb's arguments may be: its parts, a list's, homes."""
    from pbrs_farm.assets.homes_package import example_homes

    words = [str(c) for a in parser._actions if not a.option_strings for c in a.choices or ()]
    if verb in _HOME_VERBS:
        words += ["builtin", *(home.name for home in example_homes())]
    return words


# Verbs that tell.


def add_verbs(verb: Verb) -> None:
    """Add doctor, inputs, skies, recipes, layers and completion."""
    p = verb("doctor", _doctor, "what this machine can do, and what to do about what is missing")
    p.add_argument("--json", action="store_true", help="for machines")
    p.add_argument("--store", default=os.environ.get("PBRS_STORE", ""), help="store to try")
    p.add_argument("--redis", default=os.environ.get("PBRS_REDIS_URL", ""), help="Redis to try")
    text = "the formats of houses that are read: what each brings, where one gets it, its licence"
    p = verb("inputs", _inputs, text)
    p.add_argument("--json", action="store_true", help="for machines")
    p = verb("skies", _skies, "fetch four outdoor panoramas (CC0) from Debian's blender-data")
    p = verb("recipes", _recipes, "every field of a recipe and its value")
    p.add_argument("name", nargs="?", default="fast", choices=RECIPE_NAMES)
    p.add_argument("--toml", action="store_true", help="as a file for --recipe FILE.toml")
    p = verb("layers", _layers, "the table of the files of a view")
    text = 'what makes the shell complete words: eval "$(pbrs-farm completion bash)"'
    p = verb("completion", _completion, text)
    p.add_argument("shell", choices=SHELLS)


def _doctor(args: argparse.Namespace) -> int:
    from pbrs_farm.doctor import can_run, examine

    findings = examine(args.store, args.redis)
    fine = can_run(findings)
    if args.json:
        echo_json({"can_run": fine, "findings": [asdict(f) for f in findings]})
        return 0 if fine else 1
    for f in findings:
        # One line a part, and what to do where it is not fine.
        mark = {"ok": "ok      ", "degraded": "degraded", "missing": "MISSING "}[f.state]
        echo(f"{mark}  {f.part:<20} {f.text}")
        if f.state != "ok" and f.remedy:
            echo(f"{'':<32}-> {f.remedy}")
    echo()
    missing = "This machine cannot render yet: see MISSING above."
    echo("This machine can render." if fine else missing)
    return 0 if fine else 1


def _inputs(args: argparse.Namespace) -> int:
    from pbrs_farm.read.formats import formats

    if args.json:
        echo_json([row._asdict() for row in formats()])
        return 0
    for row in formats():
        echo(f"{row.title}: {row.files}")
        echo(f"    brings    {row.brings}")
        if row.needs:
            echo(f"    needs     {row.needs}")
        echo(f"    from      {row.where}; {row.licence}")
    return 0


def _skies(_args: argparse.Namespace) -> int:
    from pbrs_farm.assets.skies import fetch_skies

    folder = fetch_skies()
    for path in sorted(folder.glob("*.exr")):
        echo(str(path))
    echo(f"use them with: --set sky.kind=panorama --set sky.panoramas={folder}")
    return 0


def _recipes(args: argparse.Namespace) -> int:
    recipe = recipe_from_name(args.name)
    if args.toml:
        from pbrs_farm.formats.recipe_toml import toml_from_recipe

        echo(toml_from_recipe(recipe))
        return 0
    echo(f"# recipe {args.name}; --set group.field=value overrides any field")
    # Print the recipe as --set takes it, group by group.
    for group, info in Recipe.model_fields.items():
        value = getattr(recipe, group)
        # Fields of the recipe itself, like the seed, stand alone.
        if not hasattr(type(value), "model_fields"):
            echo(f"{group} = {json.dumps(value)}")
            continue
        echo(f"\n# {info.annotation.__doc__ if info.annotation else ''}")
        for name, field in type(value).model_fields.items():
            text = f"{group}.{name} = {json.dumps(getattr(value, name))}"
            echo(f"{text:<48} # {field.description}" if field.description else text)
    return 0


def _layers(_args: argparse.Namespace) -> int:
    from pbrs_farm.core.layers import table, text_table

    echo(text_table(shutil.get_terminal_size().columns) if sys.stdout.isatty() else table())
    return 0


def _completion(args: argparse.Namespace) -> int:
    echo(completion_script(args.shell, args.every_verb().verbs()))
    return 0
