"""A disk cache of painted materials, a hundred times as fast as painting and equal to it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Lock
from typing import Final

from pydantic import TypeAdapter, ValidationError

from pbrs_farm.assets.debian import drop_oldest, read_used, write_whole
from pbrs_farm.core import keys
from pbrs_farm.core.house import Material, Texture
from pbrs_farm.dress.content import content
from pbrs_farm.dress.painted_materials import Painted, Painting

MOST_BYTES: Final = 2_000_000_000  # maximum size; the oldest entries are removed first
_MAKERS: Final = ("numpy", "OpenImageIO")  # the packages whose versions may change a pixel


@dataclass(frozen=True, slots=True)
class _Described:
    # Fields of a painted material that are not pictures.
    material: Material
    mean_rgb: tuple[float, float, float]
    textures: tuple[tuple[str, str, str, int], ...]  # id, name, media type, bytes


_DESCRIBED: Final = TypeAdapter(_Described)


class PaintedBank:
    """Painted materials by key, in a folder that processes may share, or (None) in memory alone."""

    def __init__(self, folder: Path | None, most_bytes: int = MOST_BYTES) -> None:
        self._folder = folder
        self._most_bytes = most_bytes
        self._lock = Lock()
        self._known: dict[str, Painting] = {}

    def painted(self, key: str, paint: Callable[[], Painted]) -> Painted:
        """The cached material of a key (all inputs but code), painted if missing or damaged."""
        # Two threads that ask for one wait for each other, and for nothing else.
        with self._lock:
            painting = self._known.setdefault(key, Painting(lambda: self._kept(key, paint)))
        return painting.painted()

    def _kept(self, key: str, paint: Callable[[], Painted]) -> Painted:
        if self._folder is None:
            return paint()
        path = self._folder / f"{keys.digest(key, _makers())}.painted"
        with suppress(OSError, ValueError):
            return _unpacked(read_used(path))
        painted = paint()
        with suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            write_whole(path, _packed(painted))
            drop_oldest(path, self._most_bytes)
        return painted


@cache
def _makers() -> str:
    """The digest of the code that paints, and of the packages it paints with."""
    folder = Path(__file__).parent
    ours = [folder / f"{name}.py" for name in ("noise", "patterns", "style", "surface_maps")]
    code = hashlib.sha256()
    for path in (*content().paint_files, *ours):
        code.update(path.read_bytes())
    return keys.digest(code.hexdigest(), *(version(name) for name in _MAKERS))


def _packed(painted: Painted) -> bytes:
    rows = tuple((t.id, t.name, t.media_type, len(t.data)) for t in painted.textures)
    described = _DESCRIBED.dump_json(_Described(painted.material, painted.mean_rgb, rows))
    content = b"\n".join([described, b"".join(t.data for t in painted.textures)])
    return b"\n".join([hashlib.sha256(content).hexdigest().encode(), content])


def _unpacked(data: bytes) -> Painted:
    """Inverse of _packed; ValueError for any other data."""
    digest, _, content = data.partition(b"\n")
    if hashlib.sha256(content).hexdigest().encode() != digest:
        raise ValueError("damaged")
    text, _, pixels = content.partition(b"\n")
    try:
        described = _DESCRIBED.validate_json(text)
    except ValidationError as error:  # an earlier version's
        raise ValueError(str(error)) from error
    textures, start = [], 0
    for id_, name, media_type, n in described.textures:
        textures.append(Texture(id_, name, media_type, pixels[start : start + n]))
        start += n
    return Painted(described.material, tuple(textures), described.mean_rgb)
