"""Digests of the files that a source reads beside its own. Effect: reads files."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.common.mtl_files import read_mtl
from pbrs_farm.read.common.root_folder import RootFolder
from pbrs_farm.regular_files import digest_of_regular


class SourceFiles:
    """Files looked at while sources are named, each read once; state: what was found so far.

    Listing never fails: a file that is damaged or lies outside its folder counts as absent here,
    and the reader says what is wrong with it.
    """

    def __init__(self) -> None:
        self._digests: dict[tuple[Path, str], str] = {}  # (root, name) -> sha256, "" = no file
        self._pictures: dict[tuple[Path, str], tuple[str, ...]] = {}  # of material libraries

    def file_digest(self, path: Path) -> str:
        """SHA-256 of a file; raises OSError where it cannot be read."""
        key = (path, "")
        if key not in self._digests:
            self._digests[key] = digest_of_regular(path)
        return self._digests[key]

    def digest(self, folder: RootFolder, names: Iterable[str]) -> str:
        """Digest over the names and bytes of those files that exist; "" where none does."""
        found = {name: self._digest(folder, name) for name in names}
        lines = [f"{digest}  {name}\n" for name, digest in sorted(found.items()) if digest]
        return hashlib.sha256("".join(lines).encode()).hexdigest() if lines else ""

    def pictures(self, folder: RootFolder, mtl: str) -> tuple[str, ...]:
        """Names below the root of the pictures that a material library names."""
        key = (folder.root, mtl)
        if key not in self._pictures:
            try:
                materials = read_mtl(folder, mtl) or ()
                self._pictures[key] = tuple({m.map_kd for m in materials if m.map_kd})
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
