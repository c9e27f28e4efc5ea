"""Parse and check JSON from outside, with errors of one line in our words; no effects.

A reader states its expectations as a pydantic model. The messages of `json` and pydantic are translated
here alone: the place in the file, and the expected value.
"""

from __future__ import annotations

import json
from codecs import BOM_UTF8
from collections.abc import Callable, Sequence
from functools import cache
from typing import Annotated, Any, Final, TypeVar

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.core.file_kinds import other_kind, wrong_kind
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice

T = TypeVar("T")

Finite = Annotated[float, Field(strict=True, allow_inf_nan=False)]
"""A number of the file: no text, no true, no NaN."""

_MOST_SHOWN: Final = 40  # characters of a value that does not fit
_MOST_NAMES: Final = 12  # names of fields that a hint lists


def json_from_bytes(data: bytes, file: object, *, error: type[BadInput] = BadHouse) -> Any:
    """The JSON value in data; an `error` naming file, line and column for damage, NaN or deep nesting."""
    if not data.strip():
        raise error(file, "", "not valid JSON: the text is empty")
    try:
        return json.loads(data, parse_constant=_refuse_constant)
    except RecursionError:
        place, text = "", "nested too deeply"
    except json.JSONDecodeError as fault:
        place, text = f"line {fault.lineno} column {fault.colno}", fault.msg
    except UnicodeDecodeError as fault:
        place, text = f"byte {fault.start}", "the text is not UTF-8"
    except _NoNumberError as fault:
        place, text = "", str(fault)
    except ValueError:
        place, text = "", "a number has too many digits"
    if other_kind(data, file) is not None:
        text, hint = wrong_kind(data, file)
        raise error(file, "", text, hint=hint)
    raise error(file, place, f"not valid JSON: {text}")


def utf8_of_json(data: bytes) -> bytes:
    """JSON text as UTF-8 without a byte order mark; UTF-16 and UTF-32 are converted, damage is replaced."""
    encoding = json.detect_encoding(data)
    if encoding.startswith("utf-8"):
        return data.removeprefix(BOM_UTF8)
    return data.decode(encoding, "replace").removeprefix("\ufeff").encode()


class _NoNumberError(ValueError):
    """NaN or an infinity where JSON knows none."""


def _refuse_constant(name: str) -> float:
    raise _NoNumberError(f"{name} is not a number")


def checked(
    kind: type[T] | TypeAdapter[T],
    data: object,
    file: object,
    place: str = "",
    *,
    error: type[BadInput] = BadInput,
    hint: str = "",
) -> T:
    """Validate a JSON value, or bytes of JSON, as a kind; an error names file and place. hint: its default."""
    adapter: TypeAdapter[T] = kind if isinstance(kind, TypeAdapter) else _adapter_of(kind)
    try:
        if isinstance(data, bytes):
            return adapter.validate_json(utf8_of_json(data))
        return adapter.validate_python(data)
    except ValidationError as fault:
        # Name the first fault: the others may follow from it.
        first = fault.errors(include_url=False)[0]
    if first["type"] == "json_invalid" and isinstance(data, bytes):
        # json gives the place of a syntax error, and nests deeper than pydantic.
        json_from_bytes(data, file, error=error)
        raise error(file, "", "not valid JSON: nested too deeply", hint=hint)
    if first["type"] == "extra_forbidden":
        word, field_names = str(first["loc"][-1]), _field_names(adapter)
        offer = hint_of_choice if len(field_names) <= _MOST_NAMES else did_you_mean
        hint = offer(word, field_names) or hint
    inner = place_in(first["loc"])
    between = ", " if place and inner and inner[0] != "[" else ""
    raise error(file, f"{place}{between}{inner}", sentence(first), hint=hint)


_adapter_of: Final[Callable[[Any], TypeAdapter[Any]]] = cache(TypeAdapter)


def _field_names(adapter: TypeAdapter[Any]) -> list[str]:
    """The fields of every model that the adapter's kind is made of."""
    schema = adapter.json_schema()
    models = [schema, *schema.get("$defs", {}).values()]
    return [name for model in models for name in model.get("properties", {})]


def place_in(path: Sequence[int | str]) -> str:
    """A place below a value as a reader would point to it: materials[0].texture.

    Numbers are indices and become [0]; names are joined by dots; an empty path gives "".

        >>> place_in(["materials", 0, "texture"])
        'materials[0].texture'
    """
    steps = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in path)
    return "".join(steps).removeprefix(".")


_SENTENCES: Final = {
    "missing": "is missing",
    "extra_forbidden": "no such field",
    "unexpected_keyword_argument": "no such field",
    "finite_number": "is not a finite number",
    "too_short": "expected {min_length} values or more, got {actual_length}",
    "too_long": "expected {max_length} values at most, got {actual_length}",
    "string_too_short": "expected {min_length} characters or more",
    "string_too_long": "expected {max_length} characters at most",
    "string_pattern_mismatch": "does not match {pattern}",
    "greater_than": "expected more than {gt:g}",
    "greater_than_equal": "expected {ge:g} or more",
    "less_than": "expected less than {lt:g}",
    "less_than_equal": "expected {le:g} or less",
    "literal_error": "expected {expected}",
    "enum": "expected {expected}",
}
# fmt: off
_WANTED: Final = {
    "string": "a text", "int": "a whole number", "float": "a number", "bool": "true or false",
    "list": "a list", "tuple": "a list", "set": "a list", "frozen": "a list", "none": "null",
    "dict": "an object", "model": "an object", "dataclass": "an object", "mapping": "an object",
}
# fmt: on


def sentence(fault: ErrorDetails) -> str:
    """A pydantic error as one plain sentence: a validator's own, one of here, or expected and actual value."""
    kind, facts = fault["type"], fault.get("ctx", {})
    if kind in ("value_error", "assertion_error"):
        return str(facts["error"])  # our own validators write sentences
    if kind in _SENTENCES:
        text = _SENTENCES[kind].format(**facts)
    else:
        expected_kind = _WANTED.get(kind.partition("_")[0])
        text = f"expected {expected_kind}" if expected_kind else "has the wrong type"
    tells_value = text.startswith("expected") and ", got" not in text
    return f"{text}, got {_shown_value(fault['input'])}" if tells_value else text


def _shown_value(value: object) -> str:
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, int) and value.bit_length() > 64:
        return "a number of many digits"
    value = value[:_MOST_SHOWN] if isinstance(value, str) else value
    text = json.dumps(value, ensure_ascii=False, default=str)
    return text if len(text) <= _MOST_SHOWN else f"{text[: _MOST_SHOWN - 3]}..."


def exactly(n: int, what: str = "numbers") -> BeforeValidator:
    """In Annotated, before the item's type: a list or tuple of n values, called `what` in its one error."""

    def check(value: object) -> object:
        if not isinstance(value, list | tuple) or len(value) != n:
            raise ValueError(f"expected {n} {what}")
        return value

    return BeforeValidator(check)
