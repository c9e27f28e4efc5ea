"""The parser: commands by purpose, options before or after the verb, suggestions for errors. Effects: prints."""

from __future__ import annotations

import argparse
import csv
import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple, NoReturn

from pbrs_farm.commands.options import group_of
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice

_TABLE: Final = Path(__file__).with_name("verbs.csv")


@dataclass(frozen=True, slots=True)
class VerbRow:
    """A row of verbs.csv. group: heading in the help; examples: with ; between, without the program's name."""

    verb: str
    group: str
    module: str
    help: str
    examples: str


def _rows() -> tuple[VerbRow, ...]:
    lines = _TABLE.read_text(encoding="utf-8").splitlines()
    return tuple(VerbRow(*row) for row in csv.reader(lines[2:]))


VERBS: Final = {row.verb: row for row in _rows()}
"""Every verb, in the order of the help."""

_TYPES: Final = {"text": str, "int": int, "float": float, "path": Path}
# Phrases that several rows of arguments.csv have.
_PHRASES: Final = {
    "HOME": "home file, folder of home files (not of subfolders; `inputs` lists the formats), example"
    " home's name, `builtin`, `made:SEED`, or `plugin:NAME,SEED`",
    "VIEW": "folder of a view: OUT/houses/<house>/views/<view>",
    "ON": "[NAME=]ROOT[@MODE], nyu_depth_v2_labeled.mat, or a folder of photographs with depth;"
    " repeatable",
}


class _ArgumentRow(NamedTuple):
    """A row of arguments.csv, whose head explains the columns."""

    verbs: str
    argument: str
    type: str
    many: str
    default: str
    metavar: str
    choices: str
    group: str
    help: str

    def words(self) -> dict[str, Any]:
        """The keywords of add_argument."""
        text = self.help.format_map(_PHRASES)
        if self.type == "flag":
            return {"action": "store_true", "help": text}
        if self.type == "switch":
            return {"action": argparse.BooleanOptionalAction, "help": text}
        kind = _TYPES[self.type]
        words: dict[str, Any] = {"type": kind, "metavar": self.metavar or None, "help": text}
        if self.choices:
            words["choices"] = [kind(choice) for choice in self.choices.split()]
        for mark in self.many.split():
            if mark == "repeat":
                words |= {"action": "append", "default": []}
            elif mark == "required":
                words["required"] = True
            else:
                nargs, _equals, const = mark.partition("=")
                words |= {"nargs": nargs, "const": const} if const else {"nargs": nargs}
        if self.default:
            values = [kind(word) for word in self.default.strip("[]").split()]
            words["default"] = (
                values if self.many == "+" else "" if self.default == "''" else values[0]
            )
        return words


@functools.cache
def _argument_rows() -> tuple[_ArgumentRow, ...]:
    lines = _TABLE.with_name("arguments.csv").read_text(encoding="utf-8").splitlines()
    return tuple(_ArgumentRow(*row) for row in csv.reader(lines[2:]))


def add_arguments(p: argparse.ArgumentParser, verb: str) -> None:
    """Add the verb's rows of arguments.csv, in their order, each to its group of the help."""
    for row in _argument_rows():
        if verb in row.verbs.split():
            name, *field = row.argument.split()
            words = row.words() | ({"dest": field[0]} if field else {})
            (group_of(p, row.group) if row.group else p).add_argument(name, **words)


class Parser(argparse.ArgumentParser):
    """An ArgumentParser whose help lists verbs in groups, or ends with a verb's examples."""

    examples: tuple[str, ...] = ()

    options_by_words: Callable[[Parser, Sequence[str] | None], None] | None = None
    """Adds a verb's options that depend on the words given, such as the form of --to; all for None."""

    def verbs(self) -> dict[str, Parser]:
        """Verb -> its parser, in the order of addition; empty for the parser of a verb."""
        actions = [a for a in self._actions if isinstance(a, argparse._SubParsersAction)]
        return dict(actions[0].choices) if actions else {}

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        """As argparse's, with the nearest choices in the message."""
        if action.choices is not None and value not in action.choices:
            near = hint_of_choice(str(value), [str(choice) for choice in action.choices])
            raise argparse.ArgumentError(action, f"invalid choice: {value!r} ({near})")

    def error(self, message: str) -> NoReturn:
        """Exit with one line, without the usage, which takes a screen for some verbs."""
        self.exit(2, f"{self.prog}: error: {message} (see `{self.prog} --help`)\n")

    def format_help(self) -> str:
        """The help text: argparse's for a verb, the verbs in groups for the command."""
        actions = [a for a in self._actions if isinstance(a, argparse._SubParsersAction)]
        if not actions or actions[0].metavar != "COMMAND":
            examples = [f"  pbrs-farm {example}\n" for example in self.examples]
            return "".join([super().format_help(), *["\nexamples:\n"] * bool(examples), *examples])
        lines = {action.dest: action for action in actions[0]._choices_actions}
        formatter = self._get_formatter()
        formatter.add_usage(self.usage, self._actions, self._mutually_exclusive_groups)
        formatter.add_text(self.description)
        rows = [row for row in VERBS.values() if row.verb in lines]
        for group in dict.fromkeys(row.group for row in rows):
            formatter.start_section(group)
            formatter.add_arguments([lines[row.verb] for row in rows if row.group == group])
            formatter.end_section()
        formatter.add_text(self.epilog)
        formatter.add_text(
            "`pbrs-farm COMMAND --help` lists the options of a command, with examples."
        )
        return formatter.format_help()


def unknown_words(words: Sequence[str], parser: argparse.ArgumentParser) -> str:
    """Message about words that a verb does not accept: the closest option, or the first surplus word."""
    options = [word for word in words if word.startswith("-")]
    if not options:
        if "=" in words[0] and "--set" in parser._option_string_actions:
            return f"unexpected word {words[0]!r}: each field has its own --set, `--set {words[0]}`"
        return f"unexpected word {words[0]!r}"
    name = options[0].partition("=")[0]
    offer = did_you_mean(name, parser._option_string_actions)
    return f"no such option {name}" + (f", {offer}" if offer else "")


def verb_first(
    words: Sequence[str], verbs: Sequence[str], parser_of: Callable[[str], argparse.ArgumentParser]
) -> list[str]:
    """Move the verb before its own options, by how many words each takes (parser_of)."""
    # A word is the verb only if all words before it are its options and their values.
    if words and words[0].startswith("-"):
        for position, word in enumerate(words):
            if word in verbs and _are_options(words[:position], parser_of(word)):
                return [word, *words[:position], *words[position + 1 :]]
    return list(words)


def _are_options(words: Sequence[str], parser: argparse.ArgumentParser) -> bool:
    """True if the words are options of the parser, each with its values."""
    k = 0
    while k < len(words):
        name, equals, _value = words[k].partition("=")
        action = parser._option_string_actions.get(name)
        if action is None:
            return False
        k += 1
        if equals or action.nargs == 0:
            continue
        # Skip one value, or all up to the next option.
        first = k
        while k < len(words) and not words[k].startswith("-") and (k == first or action.nargs):
            k += 1
        if k == first:
            return False
    return True
