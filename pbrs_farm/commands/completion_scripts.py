"""Completion scripts for bash, zsh and fish: verbs, options and their choices. No effects."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterator, Mapping
from typing import Final

SHELLS: Final = ("bash", "zsh", "fish")

# Completions that argparse does not know: example homes and recipes.
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
    """The shell's completion script (one of SHELLS): verbs, options, choices, example homes."""
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
    # compgen keeps the words that begin with the typed text.
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
            # -x: only these words may follow the option, no file names.
            words = f" -x -a {shlex.quote(' '.join(values[option]))}" if option in values else ""
            yield f"{of_verb} -l {option.removeprefix('--')}{words}"
        if arguments := _arguments(verb, parser):
            yield f"{of_verb} -a {shlex.quote(' '.join(arguments))}"


def _options(parser: argparse.ArgumentParser) -> list[str]:
    return sorted(name for name in parser._option_string_actions if name.startswith("--"))


def _option_choices(parser: argparse.ArgumentParser) -> Iterator[tuple[str, list[str]]]:
    """Each option with a fixed set of values, and those values."""
    from pbrs_farm.core.layers import OPTIONAL
    from pbrs_farm.core.lighting import ALL_MODES
    from pbrs_farm.core.recipe import CAMERA_SOURCES, RECIPE_NAMES

    # Options that take lists declare no choices.
    choices = {
        "--recipe": list(RECIPE_NAMES),
        "--modes": [mode.value for mode in ALL_MODES],
        "--layers": list(OPTIONAL),
        "--cameras": list(CAMERA_SOURCES.names()),
    }
    for name, action in parser._option_string_actions.items():
        if action.choices and name.startswith("--"):
            yield name, [str(choice) for choice in action.choices]
        elif name in choices:
            yield name, choices[name]


def _arguments(verb: str, parser: argparse.ArgumentParser) -> list[str]:
    """Completions of a verb's arguments: subcommands, choices of a list, or homes."""
    from pbrs_farm.assets.homes_package import example_homes

    words = [str(c) for a in parser._actions if not a.option_strings for c in a.choices or ()]
    if verb in _HOME_VERBS:
        words += ["builtin", *(home.name for home in example_homes())]
    return words
