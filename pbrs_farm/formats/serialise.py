"""Frozen dataclasses <-> JSON values, directed by the types of their fields; JSON as bytes; no effects."""

from __future__ import annotations

import functools
import json
import math
import types
import typing
from dataclasses import MISSING, Field, fields, is_dataclass
from enum import Enum
from json.encoder import encode_basestring_ascii
from typing import Any, Final

import numpy as np
from pydantic import BaseModel
from pydantic_core import to_jsonable_python

from pbrs_farm.core.errors import BadHouse

# Shape of an array field by class and field (None = any length).
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


def json_from_value(value: Any) -> Any:
    """Dicts, lists, numbers and strings that say the same as value, a frozen dataclass with arrays."""
    return to_jsonable_python(value, fallback=_list_from_array, inf_nan_mode="constants")


def _list_from_array(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is no JSON value")


def json_bytes(value: Any) -> bytes:
    """Readable JSON, keys sorted: equal values give equal bytes. value: a model or JSON values."""
    if isinstance(value, BaseModel):
        value = value.model_dump(mode="json")
    return (json.dumps(value, sort_keys=True, indent=1, ensure_ascii=False) + "\n").encode(
        "utf-8", "replace"
    )


def pretty_json(value: Any) -> str:
    """JSON with sorted keys, one line per leaf list: equal values give equal text.

    Raises ValueError for a number that is not finite.
    """
    return _pretty(value, "") + "\n"


def _pretty(value: Any, indent: str) -> str:
    deeper = indent + "  "
    if isinstance(value, dict) and value:
        rows = [f"{_leaf(k)}: {_pretty(value[k], deeper)}" for k in sorted(value)]
        return "{\n" + ",\n".join(deeper + r for r in rows) + "\n" + indent + "}"
    if isinstance(value, list) and _holds_dict(value):
        return "[\n" + ",\n".join(deeper + _pretty(v, deeper) for v in value) + "\n" + indent + "]"
    return _leaf(value)


def _leaf(value: Any) -> str:
    # As json.dumps, which takes longer to begin than a short text takes.
    if type(value) is str:
        return encode_basestring_ascii(value)
    return str(value) if type(value) is int else json.dumps(value, allow_nan=False)


def _holds_dict(value: Any) -> bool:
    return isinstance(value, list) and any(isinstance(v, dict) or _holds_dict(v) for v in value)


def value_from_json(hint: Any, data: Any, file: str, place: str) -> Any:
    """The value of type hint that JSON values say; arrays and bytes among them pass through.

    Unknown keys are ignored, missing fields take their defaults; what does not fit is BadHouse.
    """
    if hint in _SCALARS:
        return _scalar(hint, data, file, place)
    origin = _origin(hint)
    if origin is np.ndarray:
        dtype = typing.get_args(typing.get_args(hint)[1])[0]
        return _array(dtype, data, file, place)
    # "X | None" is the only union among the fields.
    if origin in (typing.Union, types.UnionType):
        kinds = [a for a in typing.get_args(hint) if a is not type(None)]
        return None if data is None else value_from_json(kinds[0], data, file, place)
    if origin is tuple:
        return _tuple(typing.get_args(hint), data, file, place)
    if origin is dict:
        return _dict(typing.get_args(hint)[1], data, file, place)
    if isinstance(hint, type) and is_dataclass(hint):
        return _dataclass(hint, data, file, place)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _enum(hint, data, file, place)
    return _scalar(hint, data, file, place)


_SCALARS: Final = (str, int, float, bool)


@functools.cache
def _origin(hint: Any) -> Any:
    return typing.get_origin(hint)


@functools.cache
def _hints(cls: type) -> dict[str, Any]:
    return typing.get_type_hints(cls)


def _dataclass(cls: type, data: Any, file: str, place: str) -> Any:
    if not isinstance(data, dict):
        raise _misfit(file, place, "an object", data)
    # Read field by field; one that is not there takes its default.
    hints = _hints(cls)
    found: dict[str, Any] = {}
    field: Field[Any]
    for field in fields(cls):
        inner = f"{place}.{field.name}" if place else field.name
        if field.name not in data:
            if field.default is MISSING and field.default_factory is MISSING:
                raise BadHouse(file, inner, "is missing")
            continue
        value = value_from_json(hints[field.name], data[field.name], file, inner)
        shape = SHAPES.get((cls.__name__, field.name))
        if shape is not None and value is not None:
            value = _shaped(value, shape, file, inner)
        found[field.name] = value
    return cls(**found)


def _array(dtype: Any, data: Any, file: str, place: str) -> np.ndarray[Any, Any]:
    # Arrays from house.glb stand in the data already.
    if isinstance(data, np.ndarray):
        if data.dtype != dtype:
            raise BadHouse(file, place, f"expected {np.dtype(dtype)}, got {data.dtype}")
        return data
    try:
        # Convert from the widest type, to see what the asked one cannot hold.
        wide = np.array(data, np.int64 if np.issubdtype(dtype, np.integer) else np.float64)
        with np.errstate(over="ignore"):  # what overflows is told below
            array = wide.astype(dtype)
    except (ValueError, TypeError, OverflowError):
        raise _misfit(file, place, f"an array of {np.dtype(dtype)}", data) from None
    if not np.isfinite(array).all() or (wide.dtype.kind == "i" and (array != wide).any()):
        raise BadHouse(file, place, "holds a number that is not finite or out of range")
    return array


def _shaped(
    array: np.ndarray[Any, Any], shape: tuple[int | None, ...], file: str, place: str
) -> np.ndarray[Any, Any]:
    # An empty list in JSON has lost its width.
    if array.size == 0 and shape[0] is None:
        return array.reshape(0, *[n or 0 for n in shape[1:]])
    if array.ndim != len(shape) or any(
        w is not None and w != n for w, n in zip(shape, array.shape)
    ):
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise BadHouse(file, place, f"expected shape ({wanted}), got {array.shape}")
    return array


def _tuple(args: tuple[Any, ...], data: Any, file: str, place: str) -> tuple[Any, ...]:
    if not isinstance(data, (list, tuple)):
        raise _misfit(file, place, "a list", data)
    if len(args) == 2 and args[1] is Ellipsis:
        return tuple(value_from_json(args[0], v, file, f"{place}[{i}]") for i, v in enumerate(data))
    if len(data) != len(args):
        raise BadHouse(file, place, f"expected {len(args)} values, got {len(data)}")
    return tuple(
        value_from_json(a, v, file, f"{place}[{i}]") for i, (a, v) in enumerate(zip(args, data))
    )


def _dict(hint: Any, data: Any, file: str, place: str) -> dict[str, Any]:
    if not isinstance(data, dict):
        raise _misfit(file, place, "an object", data)
    return {k: value_from_json(hint, v, file, f"{place}.{k}") for k, v in data.items()}


def _enum(hint: type[Enum], data: Any, file: str, place: str) -> Enum:
    try:
        return hint(data)
    except ValueError:
        known = ", ".join(str(e.value) for e in hint)
        raise _misfit(file, place, f"one of {known}", data) from None


def _scalar(hint: Any, data: Any, file: str, place: str) -> Any:
    # An int is a float where one is asked for; a bool is no number.
    if hint is float and isinstance(data, (int, float)) and not isinstance(data, bool):
        try:
            number = float(data)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise BadHouse(file, place, "is not a finite number")
        return number
    if hint is int and isinstance(data, bool):
        raise _misfit(file, place, "an int", data)
    if not isinstance(data, hint):
        raise _misfit(file, place, f"a {hint.__name__}", data)
    return data


def _misfit(file: str, place: str, wanted: str, got: Any) -> BadHouse:
    text = repr(got) if isinstance(got, (str, int, float, bool, type(None))) else type(got).__name__
    return BadHouse(file, place, f"expected {wanted}, got {text[:80]}")
