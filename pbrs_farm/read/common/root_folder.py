"""Files below one folder and nothing outside it. Effect: reads them."""

from __future__ import annotations

import hashlib
import posixpath
from pathlib import Path

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.regular_files import fault_of, read_regular, real_path


class RootFolder:
    """The files of a source below root; records all reads for a digest.

    Names are relative, with "/" between folders. A name or a symlink that leads out of root is
    rejected with BadHouse, as is a file larger than its limit.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._real = real_path(root)
        self._read: dict[str, str] = {}  # name -> sha256

    def name_from(self, folder: str, reference: str) -> str:
        """The name below root of a reference ("/" or backslashes) in a folder; BadHouse if it leads out."""
        joined = posixpath.normpath(posixpath.join(folder, reference.replace("\\", "/")))
        if joined.startswith(("/", "../")) or joined == ".." or "\0" in joined:
            raise BadHouse(self.root, folder, f"{reference[:80]!r} leads out of the folder")
        return joined

    def path(self, name: str) -> Path | None:
        """The regular file of that name, or None if it does not exist; BadHouse if it is outside.

        name: relative, from an untrusted file. Links are resolved first, so that none leads out. The path
        is the resolved one: do not derive names from it.
        """
        path = self.root / self.name_from("", name)
        try:
            if not path.is_file():
                return None
            real = real_path(path)
        except OSError:
            return None
        # Resolve links first: the real location decides.
        if not real.is_relative_to(self._real):
            raise BadHouse(self.root, name, "is a link that leads out of the folder")
        return real

    def has_folder(self, name: str) -> bool:
        """Whether a folder of that name exists below root."""
        return (self.root / self.name_from("", name)).is_dir()

    def names(self, folder: str, suffixes: tuple[str, ...]) -> list[str]:
        """Names (with the folder, as `read` takes them) of a folder's files with these suffixes; or []."""
        below = self.root / self.name_from("", folder)
        if not below.is_dir():
            return []
        return [f"{folder}/{p.name}" for p in below.iterdir() if p.suffix in suffixes]

    def read(self, name: str, *, max_bytes: int, limit: str = "") -> bytes | None:
        """The bytes of a file below the folder, or None if it does not exist; records its digest.

        max_bytes: limit. limit: the recipe field that sets max_bytes, for the message. Raises BadHouse for
        a larger file, and for a name or a link that leads out of the folder.
        """
        path = self.path(name)
        if path is None:
            return None
        try:
            size = path.stat().st_size
            if size > max_bytes:
                text = f"is {size / 1e6:.0f} MB; at most {max_bytes / 1e6:.0f} MB are read"
                raise BadHouse(self.root, name, text, hint=limit and f"limit: {limit}")
            data = read_regular(path, max_bytes)
        except OSError as error:
            raise BadHouse(self.root, name, fault_of(error)) from None
        self._read[name] = hashlib.sha256(data).hexdigest()
        return data

    @property
    def names_read(self) -> tuple[str, ...]:
        """Names of the files read so far."""
        return tuple(self._read)

    @property
    def sha256(self) -> str:
        """Hex digest over the names and bytes of all files read so far, in whatever order."""
        lines = "".join(f"{digest}  {name}\n" for name, digest in sorted(self._read.items()))
        return hashlib.sha256(lines.encode()).hexdigest()
