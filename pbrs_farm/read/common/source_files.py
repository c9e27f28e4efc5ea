"""Digests of the files that a source reads beside its own; material libraries (MTL). Effect: reads files."""

from __future__ import annotations

import hashlib
import posixpath
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.common.resources import Resources
from pbrs_farm.read.common.root_folder import RootFolder
from pbrs_farm.read.mesh.mtl import ObjMaterial, parse_mtl
from pbrs_farm.regular_files import digest_of_regular

_MAX_MTL_BYTES = 4_000_000


class Layered:
    """Contents looked up in several places, the first that has them."""

    def __init__(self, *layers: Resources | None) -> None:
        self._layers = tuple(layer for layer in layers if layer is not None)

    def read(self, name: str) -> bytes | None:
        """The content's bytes from the first layer that has it, or None."""
        for layer in self._layers:
            data = layer.read(name)
            if data is not None:
                return data
        return None


def read_mtl(folder: RootFolder, name: str) -> tuple[ObjMaterial, ...] | None:
    """The library's materials, pictures as names below the root, or None; BadHouse for a picture outside."""
    data = folder.read(name, max_bytes=_MAX_MTL_BYTES)
    if data is None:
        return None
    parent = posixpath.dirname(name)

    def below_root(name: str) -> str:
        return folder.name_from(parent, name) if name else ""

    return tuple(
        replace(m, map_kd=below_root(m.map_kd), map_d=below_root(m.map_d)) for m in parse_mtl(data)
    )


class SourceFiles:
    """Files inspected while sources are identified, each read once; damaged ones count as absent."""

    def __init__(self) -> None:
        self._digests: dict[tuple[Path, str], str] = {}  # (root, name) -> sha256, "" = no file
        self._pictures: dict[tuple[Path, str], tuple[str, ...]] = {}  # of material libraries

    def file_digest(self, path: Path) -> str:
        """SHA-256 of a file, taken once, however many houses read it; OSError if unreadable."""
        key = (path, "")
        if key not in self._digests:
            self._digests[key] = digest_of_regular(path)
        return self._digests[key]

    def digest(self, folder: RootFolder, names: Iterable[str]) -> str:
        """Digest over names and bytes of the existing ones of these files below a folder; "" for none."""
        digests = {name: self._digest(folder, name) for name in names}
        lines = [f"{digest}  {name}\n" for name, digest in sorted(digests.items()) if digest]
        return hashlib.sha256("".join(lines).encode()).hexdigest() if lines else ""

    def pictures(self, folder: RootFolder, mtl: str) -> tuple[str, ...]:
        """Names below the root of the pictures in a material library, cached; () if it is damaged."""
        key = (folder.root, mtl)
        if key not in self._pictures:
            try:
                materials = read_mtl(folder, mtl) or ()
                self._pictures[key] = tuple(
                    {name for m in materials for name in (m.map_kd, m.map_d) if name}
                )
            except BadHouse:
                self._pictures[key] = ()
        return self._pictures[key]

    def _digest(self, folder: RootFolder, name: str) -> str:
        key = (folder.root, name)
        if key not in self._digests:
            try:
                path = folder.path(name)
                self._digests[key] = "" if path is None else self.file_digest(path)
            except (BadHouse, OSError):
                self._digests[key] = ""
        return self._digests[key]
