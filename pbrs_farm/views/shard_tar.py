"""Tar shards: samples written without timestamps, members read by offset. Effects: write_samples writes.

The form is POSIX ustar with plain files only, which webdataset, tar and Python's tarfile read. Members
are found by their headers' offsets alone: tarfile takes nine times as long over a mapped shard.
"""

from __future__ import annotations

import io
import tarfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import BadInput

_BLOCK: Final = 512
_MAX_NAME: Final = 100  # bytes, of ustar without a prefix
Buffer = bytes | memoryview


@dataclass(frozen=True, slots=True)
class Member:
    """A file of a tar and the position of its bytes."""

    name: str
    at: int
    n_bytes: int


def write_samples(path: Path, samples: Iterable[tuple[str, Mapping[str, bytes]]]) -> None:
    """Write samples, (key, part -> bytes) each, as `<key>.<part>` in their order; equal samples give equal bytes.

    Dots in a key are written as `_`, since webdataset starts the part after the first dot. Files have
    mode 644, no owner, time 0. Raises BadInput for a name above 100 bytes.
    """
    with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as tar:
        for key, parts in samples:
            for part, data in parts.items():
                member = tarfile.TarInfo(f"{key.replace('.', '_')}.{part}")
                if len(member.name.encode()) > _MAX_NAME:
                    text = f"a name in a shard has at most {_MAX_NAME} bytes"
                    raise BadInput(member.name, "", text)
                member.size = len(data)
                tar.addfile(member, io.BytesIO(data))


def members_of_tar(tar: Buffer, place: str) -> Iterator[Member]:
    """The files of a tar in its order; BadInput, naming place, if it is damaged or cut short.

    Only plain files with short names, as `pack` writes them: not a reader for any tar. Lazy; reads
    only headers, not the files' bytes.
    """
    position = 0
    while position + _BLOCK <= len(tar):
        header = bytes(tar[position : position + _BLOCK])
        if not any(header):
            return
        if header[257:262] != b"ustar" or header[156:157] not in (b"0", b"\0"):
            raise BadInput(place, f"byte {position}", "not a shard of plain files: damaged")
        name = header[:_MAX_NAME].rstrip(b"\0").decode("utf-8", "replace")
        try:
            n_bytes = int(header[124:136].rstrip(b"\0 "), 8)
        except ValueError:
            raise BadInput(place, f"byte {position}", "not a shard: damaged") from None
        yield Member(name, position + _BLOCK, n_bytes)
        position += _BLOCK + n_bytes + (-n_bytes % _BLOCK)
    # A tar ends with two empty blocks.
    raise BadInput(place, "", "ends too soon: truncated", hint="copy or pack it again")


Parts = dict[str, Member]  # a view's parts by the name after its key


class OpenShard:
    """One tar, mapped or in memory, and the positions of each view's parts."""

    def __init__(self, tar: Buffer, place: str) -> None:
        self._tar = tar
        self.place = place
        self.views: list[Parts] = []  # in the tar's order
        key = None
        for member in members_of_tar(tar, place):
            # The parts of a view are adjacent members; the key ends at the first dot.
            stem, _, part = member.name.partition(".")
            if stem != key:
                self.views.append({})
                key = stem
            self.views[-1][part] = member

    def bytes_of(self, view: int, part: str) -> bytes:
        """The bytes of a part of the view with that index; raises BadInput if it lacks the part."""
        member = self.views[view].get(part)
        if member is None:
            raise BadInput(self.place, f"view {view}", f"has no {part}")
        return bytes(self._tar[member.at : member.at + member.n_bytes])
