"""Debian packages of files, written in code."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path


def write_deb(path: Path, files: dict[str, bytes]) -> None:
    """Write a Debian package of files: an ar archive with an uncompressed data.tar."""
    tar = io.BytesIO()
    with tarfile.open(fileobj=tar, mode="w") as archive:
        for name, data in files.items():
            entry = tarfile.TarInfo(f"./{name}")
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
    data = tar.getvalue()
    head = f"{'data.tar':<16}{'0':<12}{'0':<6}{'0':<6}{'100644':<8}{len(data):<10}`\n"
    path.write_bytes(b"!<arch>\n" + head.encode() + data)
