"""Values of scene files in JSON, checked: size, numbers, names, axes, overrides of materials. No effects."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Annotated, Any, Final

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    FailFast,
    Field,
    PlainValidator,
    TypeAdapter,
)

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.checked_json import Finite, exactly, json_from_bytes
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import affine, is_flattening

# Valid names of models and textures: file names that stay in their folder.
NAME: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,99}")

_COLOUR: Final = re.compile(r"#[0-9a-fA-F]{6}")
_LAST_ROW: Final = np.array([0.0, 0.0, 0.0, 1.0])
Number = Annotated[Finite, Field(gt=-1e12, lt=1e12)]


def number_array(n: int, then: Callable[[F64], F64] = np.asarray) -> PlainValidator:
    """In Annotated[F64, ...]: (n,) of a list of n numbers, as `then` makes it."""
    lists = TypeAdapter(Annotated[list[Number], exactly(n)])
    return PlainValidator(lambda value: then(np.array(lists.validate_python(value), np.float64)))


def _file_name(value: str) -> str:
    if not NAME.fullmatch(value):
        raise ValueError(f"{value[:60]!r} is not a name of a model or a texture")
    return value


def _parse_hex_colour(value: Any) -> Any:
    if not isinstance(value, str) or not _COLOUR.fullmatch(value):
        raise ValueError(f"{str(value)[:40]!r} is not #rrggbb")
    return tuple(int(value[k : k + 2], 16) / 255 for k in (1, 3, 5))


def affine_of_columns(column_major: F64) -> F64:
    m = column_major.reshape(4, 4).T
    if (np.abs(m[3] - _LAST_ROW) > 1e-6 + 1e-5 * _LAST_ROW).any():
        raise ValueError("is not affine (column-major)")
    if is_flattening(m[:3, :3]):
        raise ValueError("flattens the model (determinant 0)")
    return m


FileName = Annotated[str, AfterValidator(_file_name)]
Label = Annotated[str, BeforeValidator(lambda value: str(value)[:60])]
Vector = Annotated[F64, number_array(3)]
Lenient: Final = BeforeValidator(lambda value: value if isinstance(value, list) else [])


class Given(BaseModel):
    """An object of SUNCG's JSON; unknown fields are ignored."""

    model_config = ConfigDict(frozen=True)


class Override(Given):
    """A node's override of the model's material at the same index; None = keep the model's."""

    name: Label = ""
    texture: FileName | None = None
    diffuse: Annotated[tuple[float, float, float], BeforeValidator(_parse_hex_colour)] | None = None


Overrides = Annotated[tuple[Override, ...], FailFast(), Lenient]


class Axes(Given):
    """The scale and the directions of a file, whose lengths do not matter."""

    scale: Annotated[Finite, Field(gt=1e-6, lt=1e6)] = Field(1.0, alias="scaleToMeters")
    up: Vector = np.array([0.0, 1.0, 0.0])
    front: Vector = np.array([0.0, 0.0, 1.0])

    def world_from_house(self, file: str) -> F64:
        """(4, 4) metres, y up, z front <- the file's."""
        norms = np.linalg.norm(self.up) * np.linalg.norm(self.front)
        if not 1e-9 < norms < 1e9 or abs(self.up @ self.front) > 1e-6 * norms:
            raise BadHouse(file, "up, front", "are not two directions at right angles")
        up, front = self.up / np.linalg.norm(self.up), self.front / np.linalg.norm(self.front)
        # Make the third axis of the two, so that the frame is right-handed.
        return affine(self.scale * np.array([np.cross(up, front), up, front]))


MAX_JSON_BYTES: Final = 192_000_000
"""Of a house's file: furnished houses have a tenth of it."""

# A list or an object takes some 60 bytes and more, a number 32: together they stay below 2 GB.
_MOST_GROUPS: Final = 4_000_000
_MOST_VALUES: Final = 24_000_000


def bounded_json(data: bytes, file: str) -> Any:
    """Parse JSON; BadHouse for invalid text, or (by counting brackets and commas first) for too many values."""
    n_groups = data.count(b"{") + data.count(b"[")
    n_values = data.count(b",")
    if n_groups > _MOST_GROUPS or n_values > _MOST_VALUES:
        text = f"has {n_groups} objects and lists and {n_values} values, more than any house"
        raise BadHouse(file, "", text)
    return json_from_bytes(data, file)
