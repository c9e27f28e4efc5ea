"""Frozen dataclasses <-> JSON values, directed by the types of their fields; JSON as bytes; no effects."""

from __future__ import annotations

import functools
import json
import typing
from collections.abc import Callable
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from json.encoder import encode_basestring_ascii
from typing import Annotated, Any, Final, TypeVar

import numpy as np
from pydantic import BaseModel, GetPydanticSchema, TypeAdapter
from pydantic_core import CoreSchema, to_jsonable_python
from pydantic_core import core_schema as cs

from pbrs_farm.core.checked_json import checked, exactly
from pbrs_farm.core.errors import BadHouse

T = TypeVar("T")

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
    """JSON values of a frozen dataclass with arrays; arrays become lists. NaN and infinities stay floats."""
    return to_jsonable_python(value, fallback=_list_from_array, inf_nan_mode="constants")


def _list_from_array(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} is not a JSON value")


def json_bytes(value: Any) -> bytes:
    """Readable JSON of a model or values, keys sorted, a newline at the end: equal for equal values."""
    if isinstance(value, BaseModel):
        value = value.model_dump(mode="json")
    return (json.dumps(value, sort_keys=True, indent=1, ensure_ascii=False) + "\n").encode(
        "utf-8", "replace"
    )


def pretty_json(value: Any) -> str:
    """JSON with sorted keys, one line per leaf list; ValueError for a number that is not finite."""
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


def value_from_json(kind: type[T], data: Any, file: str) -> T:
    """A dataclass from JSON values, arrays and bytes; unknown keys are ignored. BadHouse for misfits."""
    adapter: TypeAdapter[T] = _adapter_of(kind)
    return checked(adapter, data, file, error=BadHouse)


_adapter_of: Final[Callable[[Any], TypeAdapter[Any]]] = functools.cache(
    lambda kind: TypeAdapter(Annotated[Any, GetPydanticSchema(lambda *_: _schema(kind))])
)


_SCALARS: Final[dict[Any, CoreSchema]] = {
    str: cs.str_schema(strict=True),
    bytes: cs.bytes_schema(strict=True),
    bool: cs.bool_schema(strict=True),
    int: cs.int_schema(strict=True),
    float: cs.float_schema(strict=True, allow_inf_nan=False),  # an int is one, too
}


def _schema(hint: Any, shape: tuple[int | None, ...] | None = None) -> CoreSchema:
    """pydantic's schema for a type; shape: of an array."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    # Since Python 3.12 numpy's NDArray is an alias by the `type` statement, which hides its target.
    if (aliased := getattr(origin, "__value__", None)) is not None:
        return _schema(aliased[args], shape)
    if origin is np.ndarray:
        dtype = typing.get_args(args[1])[0]
        return cs.no_info_plain_validator_function(
            functools.partial(_array_from_json, dtype, shape)
        )
    # "X | None" is the only union among the fields.
    if type(None) in args:
        return cs.nullable_schema(_schema(args[0], shape))
    if origin is tuple and args[-1] is Ellipsis:
        return cs.tuple_schema([_schema(args[0])], variadic_item_index=0, fail_fast=True)
    if origin is tuple:
        check: Any = exactly(len(args), "values").func
        return cs.no_info_before_validator_function(check, cs.tuple_schema([*map(_schema, args)]))
    if origin is dict:
        return cs.dict_schema(_SCALARS[str], _schema(args[1]))
    if is_dataclass(hint):
        return _schema_of_dataclass(hint)
    if issubclass(hint, Enum):
        return cs.enum_schema(hint, list(hint), sub_type="str")
    return _SCALARS[hint]


def _schema_of_dataclass(cls: Any) -> CoreSchema:
    hints, rows = typing.get_type_hints(cls), []
    for field in fields(cls):
        schema = _schema(hints[field.name], SHAPES.get((cls.__name__, field.name)))
        if field.default is not MISSING:
            schema = cs.with_default_schema(schema, default=field.default)
        rows.append(cs.dataclass_field(field.name, schema, kw_only=True))
    arguments = cs.dataclass_args_schema(cls.__name__, rows)
    return cs.dataclass_schema(cls, arguments, [row["name"] for row in rows], slots=True)


def _array_from_json(
    dtype: Any, shape: tuple[int | None, ...] | None, data: Any
) -> np.ndarray[Any, Any]:
    # Arrays from house.glb are in the data already.
    if isinstance(data, np.ndarray):
        if data.dtype != dtype:
            raise ValueError(f"expected {np.dtype(dtype)}, got {data.dtype}")
        return _shaped(data, shape)
    try:
        # Convert from the widest type, to see what the asked one cannot hold.
        wide = np.array(data, np.int64 if np.issubdtype(dtype, np.integer) else np.float64)
        with np.errstate(over="ignore"):  # an overflow is an error below
            array = wide.astype(dtype)
    except (ValueError, TypeError, OverflowError):
        raise ValueError(f"expected an array of {np.dtype(dtype)}") from None
    if not np.isfinite(array).all() or (wide.dtype.kind == "i" and (array != wide).any()):
        raise ValueError("has a number that is not finite or out of range")
    return _shaped(array, shape)


def _shaped(
    array: np.ndarray[Any, Any], shape: tuple[int | None, ...] | None
) -> np.ndarray[Any, Any]:
    if shape is None:
        return array
    # An empty list in JSON has lost its width.
    if array.size == 0 and shape[0] is None:
        return array.reshape(0, *[n or 0 for n in shape[1:]])
    if array.ndim != len(shape) or any(
        w is not None and w != n for w, n in zip(shape, array.shape)
    ):
        expected = ", ".join("any" if n is None else str(n) for n in shape)
        raise ValueError(f"expected shape ({expected}), got {array.shape}")
    return array
