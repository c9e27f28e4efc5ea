"""Tar shards written without a clock and read by offset, with numpy's memory at most; no effects.

The form is POSIX ustar with plain files only, which webdataset, tar and Python's tarfile read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pbrs_farm.core.errors import BadInput

_BLOCK: Final = 512
_MAX_NAME: Final = 100  # bytes, of ustar without a prefix
Buffer = bytes | memoryview


@dataclass(frozen=True, slots=True)
class Member:
    """A file of a tar: where its bytes lie."""

    name: str
    at: int
    n_bytes: int


def tar_member(name: str, data: bytes) -> bytes:
    """Header, bytes and padding of one file: mode 644, no owner, time 0."""
    encoded = name.encode()
    if len(encoded) > _MAX_NAME:
        raise BadInput(name, "", f"a name in a shard has at most {_MAX_NAME} bytes")
    header = bytearray(_BLOCK)
    header[: len(encoded)] = encoded
    numbers = (b"0000644\0", b"0000000\0", b"0000000\0", b"%011o\0" % len(data), b"%011o\0" % 0)
    header[100:148] = b"".join(numbers)
    header[148:156] = b" " * 8  # the checksum is taken with spaces in its place
    header[156:157] = b"0"
    header[257:265] = b"ustar\x0000"
    header[148:156] = b"%06o\0 " % sum(header)
    return bytes(header) + data + bytes(-len(data) % _BLOCK)


def tar_end() -> bytes:
    """What ends a tar: two empty blocks."""
    return bytes(2 * _BLOCK)


def members_of_tar(tar: Buffer, place: str) -> Iterator[Member]:
    """The files of a tar in its order; BadInput, naming place, where it is damaged or cut short."""
    at = 0
    while at + _BLOCK <= len(tar):
        header = bytes(tar[at : at + _BLOCK])
        if not any(header):
            return
        if header[257:262] != b"ustar" or header[156:157] not in (b"0", b"\0"):
            raise BadInput(place, f"byte {at}", "not a shard of plain files: damaged")
        name = header[:_MAX_NAME].rstrip(b"\0").decode("utf-8", "replace")
        try:
            n_bytes = int(header[124:136].rstrip(b"\0 "), 8)
        except ValueError:
            raise BadInput(place, f"byte {at}", "not a shard: damaged") from None
        yield Member(name, at + _BLOCK, n_bytes)
        at += _BLOCK + n_bytes + (-n_bytes % _BLOCK)
    # Two empty blocks were to come.
    raise BadInput(place, "", "ends too soon: truncated", hint="copy or pack it again")
