"""Parameters of generated furniture: drawn by a seed, or chosen by the user; no effects.

A family with parameters has a frozen dataclass. One function draws it, another builds from it:

    @dataclass(frozen=True, slots=True)
    class Pedestal:
        foot: Annotated[str, Choice("round", "square")]
        stone: Material
        neck_m: Annotated[float, Range(0.05, 0.2)]  # radius of the neck

The annotations are what `changed` checks: bool, int and float within a Range, str of a Choice, Material
(a colour is taken for one), and a tuple of one of these, for which a single value is repeated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import (
    Annotated,
    Any,
    NamedTuple,
    NoReturn,
    TypeVar,
    get_args,
    get_origin,
    get_type_hints,
)

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Material
from pbrs_farm.core.shown_text import did_you_mean, hint_of_choice
from pbrs_farm.dress.thing_materials import plain

P = TypeVar("P")


class Choice:
    """The words that a parameter may be."""

    def __init__(self, *words: str) -> None:
        self.words = words


class Range(NamedTuple):
    """Least and greatest value of a number."""

    low: float
    high: float


Legs = Annotated[str, Choice("square", "round", "tapered", "turned", "hairpin", "bun")]
Pull = Annotated[str, Choice("bar", "bow", "square", "knob", "disc", "ring", "cup", "edge", "none")]
Front = Annotated[str, Choice("flat", "shaker", "grooved", "raised", "glazed")]


def changed(drawn: P, given: Mapping[str, object], name: str) -> P:
    """The drawn parameters with those that the user gives.

    name: of the item, for messages. Raises BadInput for an unknown parameter and for a value that
    does not fit.
    """
    hints = parameters_of(type(drawn))
    checked = {}
    for key, value in given.items():
        if key not in hints:
            raise BadInput(name, "", f"has no parameter {key!r}", hint=_near(key, hints))
        checked[key] = _checked(value, hints[key], getattr(drawn, key), f"{name}, {key}")
    return replace(drawn, **checked)  # type: ignore[type-var]


def parameters_of(kind: type) -> dict[str, Any]:
    """Name and annotation of each parameter of a dataclass."""
    hints = get_type_hints(kind, include_extras=True)
    return {field.name: hints[field.name] for field in fields(kind)}


def _near(key: str, hints: Mapping[str, Any]) -> str:
    names = ["width_m", "depth_m", "height_m", *hints]
    return " ".join(x for x in (did_you_mean(key, names), f"of {', '.join(names)}") if x)


def _checked(value: Any, hint: Any, drawn: Any, place: str) -> Any:
    origin, inner = get_origin(hint), get_args(hint)
    if origin is tuple:
        values = value if isinstance(value, tuple | list) else [value] * len(drawn)
        if len(values) != len(drawn):
            _refuse(value, place, f"one value or {len(drawn)}")
        return tuple(_checked(v, inner[0], None, place) for v in values)
    if origin is Annotated:
        kind, limits = inner
        if isinstance(limits, Choice):
            if value not in limits.words:
                hint = hint_of_choice(str(value), limits.words)
                raise BadInput(place, "", f"{value!r} is not a choice", hint=hint)
            return value
        is_whole = kind is not int or (isinstance(value, int) and not isinstance(value, bool))
        return (
            in_range(value, limits, place, "a number" if kind is float else "a whole number")
            if is_whole
            else _refuse(value, place, "a whole number")
        )
    if hint is bool and not isinstance(value, bool):
        _refuse(value, place, "True or False")
    if hint is Material and not isinstance(value, Material):
        return plain(drawn.name, colour(value, place), drawn.roughness or 0.5)
    return value


def in_range(value: Any, limits: Range, place: str, words: str = "a number") -> Any:
    """The value if it is a number within the limits; BadInput otherwise."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        _refuse(value, place, words)
    if not limits.low <= value <= limits.high:
        _refuse(value, place, f"{words} in {limits.low:g}..{limits.high:g}")
    return value


def colour(value: Any, place: str) -> tuple[float, float, float]:
    """A colour from "#rrggbb" or three numbers in 0..1 (sRGB)."""
    try:
        if isinstance(value, str):
            numbers = [b / 255 for b in bytes.fromhex(value.removeprefix("#"))]
        else:
            numbers = [float(v) for v in value]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) != 3 or not all(0 <= v <= 1 for v in numbers):
        _refuse(value, place, '"#rrggbb" or three numbers in 0..1')
    return numbers[0], numbers[1], numbers[2]


def _refuse(value: Any, place: str, expected: str) -> NoReturn:
    raise BadInput(place, "", f"{value!r} does not fit, expected {expected}")
