"""The command line of a record's options (core/options.py), and the record of parsed arguments. No effects."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

    from pbrs_farm.core.options import Option
    from pbrs_farm.core.record import Record

    _Request = TypeVar("_Request", bound=Record)


def add_options(
    p: argparse.ArgumentParser, model: type[Record], group: str = "", **defaults: Any
) -> None:
    """Add the options of a model's fields, each to its group of the help.

    group: title for options without a group. defaults: option name -> default of this verb, if it
    differs from the field's.
    """
    from pbrs_farm.core.options import flag, options_of

    for name, (field, shown) in options_of(model).items():
        info = model.model_fields[field]
        default = defaults.get(name, info.default)
        words = _argparse_words(info, shown, default)
        title = shown.group or group
        text = (info.description or "").replace("{default}", str(default))
        target = group_of(p, title) if title else p
        target.add_argument(flag(name), dest=shown.into or name, help=text, **words)


def group_of(p: argparse.ArgumentParser, title: str) -> argparse._ArgumentGroup:
    """The parser's help group of that title, created if missing, so that a subject stays together."""
    for group in p._action_groups:
        if group.title == title:
            return group
    return p.add_argument_group(title)


def _argparse_words(info: FieldInfo, shown: Option, default: Any) -> dict[str, Any]:
    from pbrs_farm.core.options import choices_of, is_repeated, word_type

    kind = word_type(info)
    if kind is bool:
        return {"action": "store_true"}
    words: dict[str, Any] = {"metavar": shown.metavar, "choices": choices_of(info, shown)}
    if is_repeated(info):
        many = {"nargs": "+"} if shown.many_words else {"action": "append"}
        return {**words, **many, "default": []}
    # None means "not given" where the minimum is above the default.
    is_below = shown.least is not None and default is not None and default < shown.least
    return {**words, "type": kind, "default": None if is_below else default}


def request_from(args: argparse.Namespace, model: type[_Request], **fields: Any) -> _Request:
    """The record of parsed arguments; options that a verb lacks keep their defaults.

    fields: values of fields without an option. Raises BadInput, naming the option, for a value below its
    limit.
    """
    from pbrs_farm.core.options import check_limit, flag, options_of

    values = dict(fields)
    for name, (field, shown) in options_of(model).items():
        value = getattr(args, name, None)
        if value is None or value == [] or shown.into:
            continue
        check_limit(flag(name), "", value, shown)
        values[field] = tuple(value) if isinstance(value, list) else value
    return model(**values)
