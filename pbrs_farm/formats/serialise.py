"""Frozen values <-> plain JSON data, directed by the types of their fields; no effects."""

from __future__ import annotations

import functools
import json
import math
import types
import typing
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from typing import Any, Final

import numpy as np

from pbrs_farm.core.errors import BadHouse

SHAPES: Final[dict[tuple[str, str], tuple[int | None, ...]]] = {
    ("Surface", "positions"): (None, 3),
    ("Surface", "faces"): (None, 3),
    ("Surface", "uvs"): (None, 2),
    ("Surface", "normals"): (None, 3),
    ("Box", "centre"): (3,),
    ("Box", "half"): (3,),
    ("Box", "axes"): (3, 3),
    ("Opening", "quad"): (4, 3),
    ("Opening", "normal"): (3,),
    ("Room", "polygon"): (None, 2),
    ("StoredCamera", "eye"): (3,),
    ("StoredCamera", "towards"): (3,),
}
"""Shape of an array field by class and field (None = any length)."""


def plain_from_value(value: Any) -> Any:
    """Dicts, lists, numbers and strings that say the same as value (a frozen dataclass)."""
    if isinstance(value, Enum):
        return value.value
    if is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain_from_value(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (tuple, list)):
        return [plain_from_value(v) for v in value]
    if isinstance(value, dict):
        return {str(k): plain_from_value(v) for k, v in value.items()}
    return value


def pretty_json(value: Any) -> str:
    """JSON with sorted keys, one line per leaf list: equal values give equal text.

    Raises ValueError for a number that is not finite.
    """
    return _pretty(value, "") + "\n"


def _pretty(value: Any, indent: str) -> str:
    deeper = indent + "  "
    if isinstance(value, dict) and value:
        rows = [f"{json.dumps(k)}: {_pretty(value[k], deeper)}" for k in sorted(value)]
        return "{\n" + ",\n".join(deeper + r for r in rows) + "\n" + indent + "}"
    if isinstance(value, list) and _holds_dict(value):
        return "[\n" + ",\n".join(deeper + _pretty(v, deeper) for v in value) + "\n" + indent + "]"
    return json.dumps(value, allow_nan=False)


def _holds_dict(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(v, dict) or _holds_dict(v) for v in value)


def json_from_bytes(data: bytes, file: str) -> Any:
    """The JSON value in data; BadHouse for text that is no JSON, NaN, or absurdly deep nesting."""
    try:
        return json.loads(data, parse_constant=_refuse_constant)
    except RecursionError:
        raise BadHouse(file, "", "nested too deeply") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno} column {error.colno}"
        raise BadHouse(file, place, f"no valid JSON: {error.msg}") from None
    except ValueError as error:
        raise BadHouse(file, "", f"no valid JSON: {error}") from None


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number")


def value_from_plain(hint: Any, plain: Any, file: str, place: str) -> Any:
    """The value of type hint that plain says; arrays and bytes that stand in plain pass through.

    Raises BadHouse naming file and place where plain does not fit the type. Keys that the type
    does not know are ignored; missing fields take the type's default.
    """
    origin = typing.get_origin(hint)
    if origin is np.ndarray:
        dtype = typing.get_args(typing.get_args(hint)[1])[0]
        return _array(dtype, plain, file, place)
    if origin in (typing.Union, types.UnionType):
        kinds = [a for a in typing.get_args(hint) if a is not type(None)]
        return None if plain is None else value_from_plain(kinds[0], plain, file, place)
    if origin is tuple:
        return _tuple(typing.get_args(hint), plain, file, place)
    if origin is dict:
        return _dict(typing.get_args(hint)[1], plain, file, place)
    if isinstance(hint, type) and is_dataclass(hint):
        return _dataclass(hint, plain, file, place)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _enum(hint, plain, file, place)
    return _scalar(hint, plain, file, place)


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _dataclass(cls: type, plain: Any, file: str, place: str) -> Any:
    if not isinstance(plain, dict):
        raise _misfit(file, place, "an object", plain)
    hints = _hints(cls)
    found: dict[str, Any] = {}
    field: Field[Any]
    for field in fields(cls):
        inner = f"{place}.{field.name}" if place else field.name
        if field.name not in plain:
            if field.default is MISSING and field.default_factory is MISSING:
                raise BadHouse(file, inner, "is missing")
            continue
        value = value_from_plain(hints[field.name], plain[field.name], file, inner)
        shape = SHAPES.get((cls.__name__, field.name))
        if shape is not None and value is not None:
            value = _shaped(value, shape, file, inner)
        found[field.name] = value
    return cls(**found)


def _array(dtype: Any, plain: Any, file: str, place: str) -> np.ndarray[Any, Any]:
    if isinstance(plain, np.ndarray):
        if plain.dtype != dtype:
            raise BadHouse(file, place, f"expected {np.dtype(dtype)}, got {plain.dtype}")
        return plain
    try:
        wide = np.array(plain, np.int64 if np.issubdtype(dtype, np.integer) else np.float64)
        with np.errstate(over="ignore"):  # what overflows is told below
            array = wide.astype(dtype)
    except (ValueError, TypeError, OverflowError):
        raise _misfit(file, place, f"an array of {np.dtype(dtype)}", plain) from None
    if not np.isfinite(array).all() or (wide.dtype.kind == "i" and (array != wide).any()):
        raise BadHouse(file, place, "holds a number that is not finite or out of range")
    return array


def _shaped(
    array: np.ndarray[Any, Any], shape: tuple[int | None, ...], file: str, place: str
) -> np.ndarray[Any, Any]:
    if array.size == 0 and shape[0] is None:
        return array.reshape(0, *[n or 0 for n in shape[1:]])
    if array.ndim != len(shape) or any(
        w is not None and w != n for w, n in zip(shape, array.shape)
    ):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise BadHouse(file, place, f"expected shape ({wanted}), got {array.shape}")
    return array


def _tuple(args: tuple[Any, ...], plain: Any, file: str, place: str) -> tuple[Any, ...]:
    if not isinstance(plain, (list, tuple)):
        raise _misfit(file, place, "a list", plain)
    if len(args) == 2 and args[1] is Ellipsis:
        return tuple(
            value_from_plain(args[0], v, file, f"{place}[{i}]") for i, v in enumerate(plain)
        )
    if len(plain) != len(args):
        raise BadHouse(file, place, f"expected {len(args)} values, got {len(plain)}")
    return tuple(
        value_from_plain(a, v, file, f"{place}[{i}]") for i, (a, v) in enumerate(zip(args, plain))
    )


def _dict(hint: Any, plain: Any, file: str, place: str) -> dict[str, Any]:
    if not isinstance(plain, dict):
        raise _misfit(file, place, "an object", plain)
    return {k: value_from_plain(hint, v, file, f"{place}.{k}") for k, v in plain.items()}


def _enum(hint: type[Enum], plain: Any, file: str, place: str) -> Enum:
    try:
        return hint(plain)
    except ValueError:
        known = ", ".join(str(e.value) for e in hint)
        raise _misfit(file, place, f"one of {known}", plain) from None


def _scalar(hint: Any, plain: Any, file: str, place: str) -> Any:
    if hint is float and isinstance(plain, (int, float)) and not isinstance(plain, bool):
        try:
            number = float(plain)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise BadHouse(file, place, "is not a finite number")
        return number
    if hint is int and isinstance(plain, bool):
        raise _misfit(file, place, "an int", plain)
    if not isinstance(plain, hint):
        raise _misfit(file, place, f"a {hint.__name__}", plain)
    return plain


def _misfit(file: str, place: str, wanted: str, got: Any) -> BadHouse:
    text = repr(got) if isinstance(got, (str, int, float, bool, type(None))) else type(got).__name__
    return BadHouse(file, place, f"expected {wanted}, got {text[:80]}")
