"""Checks of calls from Python: a wrong argument is one line that names it.

No effects but warnings. The types of arguments are in the annotations of public functions; types that
several functions share are here.
"""

from __future__ import annotations

import inspect
import math
import os
import re
import sys
import types
import typing
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, wraps
from numbers import Integral, Real
from typing import Annotated, Any, Final, Literal, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np

from pbrs_farm.core.errors import BadInput, PbrsError
from pbrs_farm.core.shown_text import hint_of_choice, shown

_P = ParamSpec("_P")
_R = TypeVar("_R")

_MOST_SHOWN: Final = 60  # characters of a value that does not fit
_PACKAGE: Final = __name__.partition(".")[0]


@dataclass(frozen=True, slots=True)
class Where:
    """A condition on an argument beside its type, in an annotation: words for it, and the test."""

    words: str
    holds: Callable[[Any], bool]


def _are_numbers(value: Any, n: int) -> bool:
    try:
        array = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        return False
    return array.shape == (n,) and bool(np.isfinite(array).all())


def _is_size(value: Any) -> bool:
    return (
        len(value) == 2
        and all(_fits(v, int) and 1 <= v <= MAX_EDGE_PX for v in value)
        and value[0] * value[1] <= MAX_VIEW_PIXELS
    )


def _is_span(value: Any) -> bool:
    return _are_numbers(value, 2) and value[0] <= value[1]


MAX_EDGE_PX: Final = 16384
MAX_VIEW_PIXELS: Final = 2**27
"""Of one picture: more do not fit in memory."""

Count = Annotated[int, Where("a whole number of 1 or more", lambda v: v >= 1)]
Whole = Annotated[int, Where("a whole number of 0 or more", lambda v: v >= 0)]
NotNegative = Annotated[float, Where("a number of 0 or more", lambda v: v >= 0)]
Positive = Annotated[float, Where("a number above 0", lambda v: v > 0)]
Share = Annotated[float, Where("a number in 0..1", lambda v: 0 <= v <= 1)]
Vector = Annotated[Sequence[float], Where("three finite numbers", lambda v: _are_numbers(v, 3))]
Size = Annotated[
    tuple[int, int],
    Where(f"(width, height), whole numbers in 1..{MAX_EDGE_PX}, 134 megapixels at most", _is_size),
]
Span = Annotated[tuple[float, float], Where("(least, most), two finite numbers", _is_span)]

# Functions that give objects of a class, for callers who pass a name.
_GIVEN_BY: Final = {
    "Home": 'pf.load("builtin") gives one',
    "Model": 'pf.model("mug.glb") gives one',
    "Camera": "pf.Camera.look_at(...) and home.cameras() give some",
    "Intrinsics": "pf.Camera.look_at(...) makes them",
    "Viewpoint": "home.cameras() gives some",
    "Views": 'pf.open("out") gives them',
    "Packing": "pf.Packing(...)",
    "SampleRequest": "pf.SampleRequest(...)",
}


def checked_call(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """The function with checked arguments: BadInput for one that does not match its annotation.

    The line names the function, the argument, the expected and the given value. Arguments are not
    converted. To a caller outside the package, options of the command line in later errors become
    arguments: "layers", not "--layers".

        >>> pf.model(3)
        Traceback (most recent call last):
        pbrs_farm.core.errors.BadInput: model: path: expected text or a path, got 3
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        hints = _hints_of(function)
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError as error:
            unknown = [name for name in kwargs if name not in signature.parameters]
            names = [name for name in signature.parameters if name != "self"]
            near = hint_of_choice(unknown[0], names) if unknown else ""
            text = f"{function.__name__}(): {error}"
            raise TypeError(f"{text}; {near}" if near else text) from None
        for name, value in given.items():
            if name in hints:
                check_argument(function.__name__, name, value, hints[name])
        try:
            return function(*args, **kwargs)
        except PbrsError as error:
            # A verb of the command line that calls this has options.
            if not _is_ours(sys._getframe(1).f_globals.get("__name__", "")):
                _speak_python(error)
            raise

    return call


@cache
def _hints_of(function: Callable[..., Any]) -> dict[str, Any]:
    """The annotations of what a call names: not those of *args and **kwargs."""
    kinds = {p.name: p.kind for p in inspect.signature(function).parameters.values()}
    hints = typing.get_type_hints(function, include_extras=True)
    named = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {name: hint for name, hint in hints.items() if kinds.get(name) in named}


def check_argument(call: str, name: str, value: Any, hint: Any) -> None:
    """Raise BadInput, naming the call and the argument, where a value does not fit its annotation."""
    if _fits(value, hint):
        return
    offers = [_GIVEN_BY[cls.__name__] for cls in _classes_of(hint) if cls.__name__ in _GIVEN_BY]
    choices = get_args(hint) if get_origin(hint) is Literal else ()
    offer = hint_of_choice(str(value), [str(v) for v in choices]) if choices else ""
    text = f"expected {words_of(hint)}, got {_text_of(value)}"
    raise BadInput(call, name, text, hint=offer or "; ".join(offers[:1]))


def check_fields(record: Any) -> None:
    """Raise BadInput, naming class and field, where a dataclass's field does not fit its annotation."""
    kind = type(record)
    for name, hint in typing.get_type_hints(kind, include_extras=True).items():
        check_argument(kind.__name__, name, getattr(record, name), hint)


def as_words(words: Any) -> Any:
    """Names of layers or modes as a tuple, also of a single name; other values unchanged."""
    if isinstance(words, str):
        return (words,)
    return tuple(words) if isinstance(words, Iterable) else words


def warn_caller(text: str) -> None:
    """Warn at the line of the user's program that called into the package."""
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and _is_ours(frame.f_globals.get("__name__", "")):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, stacklevel=level)


def _is_ours(module: str) -> bool:
    return module == _PACKAGE or module.startswith(f"{_PACKAGE}.")


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of an annotation; NumPy's numbers are numbers, its arrays sequences."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        tests = (part for part in inner[1:] if isinstance(part, Where))
        return _fits(value, inner[0]) and all(part.holds(value) for part in tests)
    if origin in (Union, types.UnionType):
        return any(_fits(value, part) for part in inner)
    if origin is Literal:
        return value in inner
    if origin is tuple:
        parts = inner[:1] * len(value) if inner[1:] == (...,) and _is_listed(value) else inner
        return (
            _is_listed(value)
            and len(value) == len(parts)
            and all(_fits(v, part) for v, part in zip(value, parts, strict=True))
        )
    if origin is not None and issubclass(origin, Iterable) and not issubclass(origin, Mapping):
        return _fits_many(value, origin, inner[0])
    return _fits_plain(value, origin or hint)


def _fits_many(value: Any, origin: type, inner: Any) -> bool:
    if isinstance(value, str | bytes | os.PathLike) or not isinstance(value, Iterable):
        return False
    if not issubclass(origin, Sequence):
        # An iterator can be read only once: its reader checks it.
        return not isinstance(value, Collection) or all(_fits(v, inner) for v in value)
    is_array = isinstance(value, np.ndarray)
    return (is_array or isinstance(value, Sequence)) and all(_fits(v, inner) for v in value)


def _fits_plain(value: Any, kind: Any) -> bool:
    if kind is Any or isinstance(kind, TypeVar):
        return True
    if getattr(kind, "_is_protocol", False):
        return all(hasattr(value, name) for name in vars(kind) if not name.startswith("_"))
    if kind is None or kind is type(None):
        return value is None
    if kind is bool:
        return isinstance(value, bool | np.bool_)
    if kind in (int, float) and isinstance(value, bool | np.bool_):
        return False
    if kind is int:
        return isinstance(value, Integral)
    if kind is float:
        return isinstance(value, Real) and math.isfinite(value)
    if kind is Callable or getattr(kind, "__name__", "") == "Callable":
        return callable(value)
    return isinstance(value, kind)


def _is_listed(value: Any) -> bool:
    return isinstance(value, tuple | list) or (isinstance(value, np.ndarray) and value.ndim == 1)


_WORDS: Final = {
    int: "a whole number",
    float: "a finite number",
    str: "text",
    bool: "True or False",
}


def words_of(hint: Any) -> str:
    """An annotation in words: "text or a path"."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        named = [part.words for part in inner[1:] if isinstance(part, Where)]
        return named[0] if named else words_of(inner[0])
    if origin in (Union, types.UnionType):
        # Who leaves an argument out gives None: it goes without saying.
        kinds = [part for part in inner if part is not type(None)]
        return " or ".join(dict.fromkeys(words_of(part) for part in kinds))
    if origin is Literal:
        return "one of " + ", ".join(str(part) for part in inner)
    if origin is tuple and inner[1:] != (...,):
        return f"({', '.join(words_of(part) for part in inner)})"
    if origin is not None and inner and issubclass(origin, Iterable):
        return f"a list, each {words_of(inner[0])}"
    name = getattr(hint, "__name__", str(hint))
    if name == "Callable":
        return "a function"
    if name == "Path":
        return "a path"
    return _WORDS.get(hint, f"an {name}" if name[:1] in "AEIOU" else f"a {name}")


def _classes_of(hint: Any) -> list[type]:
    inner = [cls for part in get_args(hint) for cls in _classes_of(part)]
    return [*inner, *([hint] if isinstance(hint, type) and not get_args(hint) else [])]


def _text_of(value: Any) -> str:
    """A value as Python text, or the kind of a long one."""
    text = " ".join(repr(value).split())
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"an array of shape {value.shape}"
    if len(text) <= _MOST_SHOWN or isinstance(value, str):
        return shown(text, _MOST_SHOWN)
    name = type(value).__name__
    return f"an {name}" if name[:1] in "AEIOUaeiou" else f"a {name}"


# Words of the command line that mean something else in Python than an argument of that name.
_MEANS: Final = {"--strict": "read.strict", "--dress": "home.dress", "--update": "update=True"}


def _speak_python(error: PbrsError) -> None:
    """Let an error name arguments where it names options of the command line, in place."""
    error.message, error.hint = _in_python(error.message), _in_python(error.hint)
    if isinstance(error, BadInput):
        error.file, error.place = _in_python(error.file), _in_python(error.place)
        error.text = _in_python(error.text)
    error.args = (error.message,)


def _in_python(text: str) -> str:
    # Leave quoted commands unchanged.
    parts = re.split(r"(`[^`]*`|pbrs-farm .*)", text.replace("--set ", ""))
    options = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
    return "".join(
        part if k % 2 else options.sub(_argument_of, part) for k, part in enumerate(parts)
    )


def _argument_of(option: re.Match[str]) -> str:
    word = option.group()
    return _MEANS.get(word, word[2:].replace("-", "_"))
