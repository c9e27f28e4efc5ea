"""The options of a command line from the fields of run/request.py, and the request from what was given.

No effects. A field is written as its Option says; its type gives argparse the type, its limits are
checked when a value is given, on a command line and in a job's file alike.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeVar, get_args, get_origin

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

    from pbrs_farm.core.record import Record
    from pbrs_farm.run.request import Option

    _Request = TypeVar("_Request", bound=Record)


def flag(name: str) -> str:
    """The option of a field's name.

    >>> flag("time_budget")
    '--time-budget'
    """
    return f"--{name.replace('_', '-')}"


def add_options(p: argparse.ArgumentParser, model: type[Record], **defaults: Any) -> None:
    """Add the options of a model's fields, each to its group of the help.

    defaults: of this verb, by option's name, where they are not the field's.
    """
    from pbrs_farm.run.request import options_of

    for name, (field, shown) in options_of(model).items():
        info = model.model_fields[field]
        default = defaults.get(name, info.default)
        words = _as_argparse_takes(info, shown, default)
        group = group_of(p, shown.group) if shown.group else p
        text = (info.description or "").replace("{default}", str(default))
        group.add_argument(flag(name), dest=shown.into or name, help=text, **words)


def group_of(p: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """The parser's group of options of that title in its help, a new one where there is none.

    Options of one subject stand together, whichever function adds them.
    """
    for group in p._action_groups:
        if group.title == title:
            return group
    return p.add_argument_group(title)


def _as_argparse_takes(info: FieldInfo, shown: Option, default: Any) -> dict[str, Any]:
    kind = kind_of(info)
    if kind is bool:
        return {"action": "store_true"}
    words: dict[str, Any] = {"metavar": shown.metavar, "choices": choices_of(info, shown)}
    if is_repeated(info):
        many = {"nargs": "+"} if shown.many_words else {"action": "append"}
        return {**words, **many, "default": []}
    # None stands for what is not given, where what is given has to be more than the default.
    is_below = shown.least is not None and default is not None and default < shown.least
    return {**words, "type": kind, "default": None if is_below else default}


def kind_of(info: FieldInfo) -> type:
    """The type of one word of the option: of `int | None` int, of a tuple and of choices str."""
    of = [
        kind for kind in get_args(info.annotation) or (info.annotation,) if kind is not type(None)
    ]
    if get_origin(info.annotation) not in (UnionType, None) or get_origin(of[0]) is Literal:
        return str
    return of[0] if isinstance(of[0], type) else str


def is_repeated(info: FieldInfo) -> bool:
    """Whether the option takes many values."""
    return get_origin(info.annotation) is tuple


def choices_of(info: FieldInfo, shown: Option) -> Any:
    """The values that the option may have; None for any."""
    for kind in (info.annotation, *get_args(info.annotation)):
        if get_origin(kind) is Literal:
            return get_args(kind)
    return shown.choices


def request_from(args: argparse.Namespace, model: type[_Request], **known: Any) -> _Request:
    """The request that parsed arguments make; options that a verb lacks keep their defaults.

    known: fields that are no options. Raises BadInput, naming the option, for a value below its limit.
    """
    from pbrs_farm.run.request import options_of

    values = dict(known)
    for name, (field, shown) in options_of(model).items():
        value = getattr(args, name, None)
        if value is None or value == [] or shown.into:
            continue
        _check(flag(name), "", value, shown)
        values[field] = tuple(value) if isinstance(value, list) else value
    return model(**values)


def _check(what: str, place: str, value: Any, shown: Option) -> None:
    numbers = value if isinstance(value, list) else [value]
    if shown.least is None:
        return
    for number in numbers:
        if not shown.least <= number < math.inf:
            text = f"expected {shown.expected or f'{shown.least} or more'}"
            raise BadInput(what, place or str(value), text, hint=shown.hint)


def values_of_table(table: Mapping[str, Any], model: type[Record], file: str) -> dict[str, Any]:
    """The entries of a job file's table as parsed arguments: by option's name, checked by its field.

    Raises BadInput with file and entry for one that is no option, or that does not fit.
    """
    from pbrs_farm.run.request import options_of

    known = options_of(model)
    values: dict[str, Any] = {}
    for written, value in table.items():
        name = written.replace("-", "_")
        if name not in known:
            hint = did_you_mean(name, known)
            raise BadInput(file, written, "no such option", hint=hint)
        field, shown = known[name]
        info = model.model_fields[field]
        if isinstance(value, dict):
            raise BadInput(file, written, "expected a value, not a table")
        if is_repeated(info):
            words = value if isinstance(value, list) else [value]
            held = values.setdefault(shown.into or name, [])
            held += [_word(word, info, shown, file, written) for word in words]
        elif isinstance(value, list):
            raise BadInput(file, written, "expected one value, not a list")
        else:
            values[name] = _word(value, info, shown, file, written)
            _check(file, written, values[name], shown)
    return values


def _word(value: Any, info: FieldInfo, shown: Option, file: str, place: str) -> Any:
    kind = kind_of(info)
    if kind is bool:
        if not isinstance(value, bool):
            raise BadInput(file, place, "expected true or false")
        return value
    try:
        word = kind(str(value).lower() if isinstance(value, bool) else str(value))
    except ValueError:
        nouns = {int: "a whole number", float: "a number", Path: "a path"}
        raise BadInput(file, place, f"expected {nouns.get(kind, kind.__name__)}") from None
    choices = choices_of(info, shown)
    if choices is not None and word not in choices:
        names = [str(choice) for choice in choices]
        raise BadInput(
            file, place, f"{word} is none of them", hint=hint_of_choice(str(word), names)
        )
    return word
