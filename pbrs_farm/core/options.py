"""Options: fields of a record with a type, default, limits and help; no effects.

Command lines, files and Python calls are checked against the same field. commands/options.py makes the
command line of them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import UnionType
from typing import Any, Literal, TypeVar, cast, get_args, get_origin

from pydantic import Field
from pydantic.fields import FieldInfo

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.record import Record
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice

_NOUNS = {int: "a whole number", float: "a number", Path: "a path"}
_Options = TypeVar("_Options", bound=Record)


@dataclass(frozen=True, slots=True)
class Option:
    """How a field is written as an option: `--name`, a tuple repeated or with many words after it."""

    name: str = ""  # "" = the field's
    group: str = ""  # title in the help; "" = "options"
    metavar: str | None = None
    choices: Sequence[Any] | None = None
    many_words: bool = False  # of a tuple: --layers a b, else --set a --set b
    into: str = ""  # the option whose values these join
    sets: str = ""  # the recipe's field that it is a short form of
    least: int | None = None  # of a given value
    expected: str = ""  # in the message for a value below least; "" = "{least} or more"
    hint: str = ""


def option(
    default: Any, text: str, *, ge: float | None = None, le: float | None = None, **shown: Any
) -> Any:
    """A field that is an option: default, help ({default}: the verb's), limits, and fields of Option."""
    shown_as: dict[str, Any] = {"option": Option(**shown)}
    return Field(default, ge=ge, le=le, description=text, json_schema_extra=shown_as)


def options_of(model: type[Record]) -> dict[str, tuple[str, Option]]:
    """Option's name as in job files and namespaces -> (field, how it is written), in their order."""
    options: dict[str, tuple[str, Option]] = {}
    for field, info in model.model_fields.items():
        shown: Any = (cast(Any, info.json_schema_extra) or {}).get("option")
        if shown is not None:
            options[shown.name or field] = field, shown
    return options


def flag(name: str) -> str:
    """The command line's option for a field.

    >>> flag("time_budget")
    '--time-budget'
    """
    return f"--{name.replace('_', '-')}"


def word_type(info: FieldInfo) -> type:
    """The type of one word of the option: of `int | None` int, of a tuple and of choices str."""
    types = [
        kind for kind in get_args(info.annotation) or (info.annotation,) if kind is not type(None)
    ]
    if get_origin(info.annotation) not in (UnionType, None) or get_origin(types[0]) is Literal:
        return str
    return types[0] if isinstance(types[0], type) else str


def is_repeated(info: FieldInfo) -> bool:
    """True if the option takes many values."""
    return get_origin(info.annotation) is tuple


def choices_of(info: FieldInfo, shown: Option) -> Any:
    """The values that the option may have; None for any."""
    for kind in (info.annotation, *get_args(info.annotation)):
        if get_origin(kind) is Literal:
            return get_args(kind)
    return shown.choices


def check_limit(file: str, place: str, value: Any, shown: Option) -> None:
    """Raise BadInput at file and place if a number is below the option's limit; "" = at the number."""
    numbers = value if isinstance(value, list) else [value]
    if shown.least is None:
        return
    for number in numbers:
        if not shown.least <= number < math.inf:
            text = f"expected {shown.expected or f'{shown.least} or more'}"
            raise BadInput(file, place or str(value), text, hint=shown.hint)


def values_of_table(table: Mapping[str, Any], model: type[Record], file: str) -> dict[str, Any]:
    """A file's table as parsed arguments by option's name; BadInput with file and entry."""
    options = options_of(model)
    values: dict[str, Any] = {}
    for written, value in table.items():
        name = written.replace("-", "_")
        if name not in options:
            raise BadInput(file, written, "no such option", hint=did_you_mean(name, options))
        field, shown = options[name]
        words = _checked(value, model.model_fields[field], shown, file, written)
        if isinstance(words, list):
            values.setdefault(shown.into or name, []).extend(words)
        else:
            values[name] = words
    return values


def record_of(values: Mapping[str, Any], model: type[_Options]) -> _Options:
    """The record with values by option's name, defaults for the others; BadInput names the option."""
    fields: dict[str, Any] = {}
    for name, value in values.items():
        field, shown = options_of(model)[name]
        words = _checked(value, model.model_fields[field], shown, flag(name), "")
        fields[field] = tuple(words) if isinstance(words, list) else words
    return model(**fields)


def _checked(value: Any, info: FieldInfo, shown: Option, file: str, place: str) -> Any:
    """A value, or a list of them, in the type of its field; BadInput at file and place if it does not fit."""
    if isinstance(value, dict):
        raise BadInput(file, place, "expected a value, not a table")
    if is_repeated(info):
        words = value if isinstance(value, list | tuple) else [value]
        return [_word(word, info, shown, file, place) for word in words]
    if isinstance(value, list | tuple):
        raise BadInput(file, place, "expected one value, not a list")
    word = _word(value, info, shown, file, place)
    check_limit(file, place, word, shown)
    return word


def _word(value: Any, info: FieldInfo, shown: Option, file: str, place: str) -> Any:
    kind = word_type(info)
    if kind is bool:
        if not isinstance(value, bool):
            raise BadInput(file, place, "expected true or false")
        return value
    try:
        word = kind(str(value).lower() if isinstance(value, bool) else str(value))
    except ValueError:
        text = f"expected {_NOUNS.get(kind, kind.__name__)}"
        raise BadInput(file, place, text) from None
    choices = choices_of(info, shown)
    if choices is not None and word not in choices:
        hint = hint_of_choice(str(word), [str(choice) for choice in choices])
        raise BadInput(file, place, f"{word} is not a choice", hint=hint)
    return word
