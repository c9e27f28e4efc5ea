"""A disk cache of shapes, since parsing a model takes a hundred times as long. Effects: reads and writes its folder."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from pbrs_farm.assets.debian import write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Shape
from pbrs_farm.core.house import LightPart, Material, Surface, Texture

FORMAT: Final = 1


@dataclass(frozen=True, slots=True)
class _Described:
    # Fields of a shape that are not arrays.
    names: tuple[str, ...]  # of the surfaces
    numbers: tuple[int, ...]  # of their materials
    materials: tuple[Material, ...]
    textures: tuple[tuple[str, str, str], ...]  # id, name, media type
    lights: tuple[LightPart, ...]


_DESCRIBED: Final = TypeAdapter(_Described)


class ShapeStore:
    """Shapes by what they are made from."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def shape(self, key: tuple[str | int, ...], make: Callable[[], Shape | None]) -> Shape | None:
        """The cached shape of a key, which names all inputs; made if missing. None, cached too: unreadable."""
        path = self._folder / f"{keys.digest(FORMAT, *key)}.npz"
        with suppress(OSError, ValueError, KeyError, zipfile.BadZipFile, EOFError):
            return _read_shape(path)
        shape = make()
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, _packed(shape))
        return shape


def _packed(shape: Shape | None) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **({} if shape is None else _arrays(shape)))  # type: ignore[arg-type]
    return buffer.getvalue()


def _arrays(shape: Shape) -> dict[str, NDArray[Any]]:
    textures = tuple(shape.textures.values())
    described = _Described(
        tuple(s.name for s in shape.surfaces),
        tuple(s.material for s in shape.surfaces),
        shape.materials,
        tuple((t.id, t.name, t.media_type) for t in textures),
        shape.lights,
    )
    arrays: dict[str, NDArray[Any]] = {"described": _byte_array(_DESCRIBED.dump_json(described))}
    for k, s in enumerate(shape.surfaces):
        parts = {"p": s.positions, "f": s.faces, "u": s.uvs, "n": s.normals}
        arrays |= {f"{name}{k}": part for name, part in parts.items() if part is not None}
    return arrays | {f"t{k}": _byte_array(t.data) for k, t in enumerate(textures)}


def _byte_array(data: bytes) -> NDArray[np.uint8]:
    return np.frombuffer(data, np.uint8)


def _read_shape(path: Path) -> Shape | None:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    if not arrays:
        return None
    d = _DESCRIBED.validate_json(arrays["described"].tobytes())
    surfaces = tuple(
        Surface(
            name, arrays[f"p{k}"], arrays[f"f{k}"], number, arrays.get(f"u{k}"), arrays.get(f"n{k}")
        )
        for k, (name, number) in enumerate(zip(d.names, d.numbers, strict=True))
    )
    textures = {
        i: Texture(i, name, kind, arrays[f"t{k}"].tobytes())
        for k, (i, name, kind) in enumerate(d.textures)
    }
    return Shape(surfaces, d.materials, textures, d.lights)
