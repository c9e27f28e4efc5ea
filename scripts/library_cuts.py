"""Blanks unused parts of a shared library, so that they compress to nothing; no effects.

A blanked range is zeros of the same length: every address stays, so the library loads as before.
Format: System V ABI, ELF-64, chapters 4 and 5; networks of Open Image Denoise: its core/tza.cpp.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Final, NamedTuple

_LOAD: Final = 1
_NO_BYTES: Final = (0, 8)  # SHT_NULL, SHT_NOBITS
_DYNSYM: Final = 11
_ALLOC: Final = 2
_NETWORK: Final = "_ZN4oidn5blobs7weights"
_TZA_MAGIC: Final = b"\xd7\x41"


class Section(NamedTuple):
    """A row of the section header table: kind, flags and place in the file."""

    kind: int
    flags: int
    start: int
    stop: int
    link: int


class Segment(NamedTuple):
    """A run of the file that the loader maps to an address."""

    start: int
    stop: int
    address: int


def without_debug(library: bytes) -> bytes:
    """The library with all sections blanked that the loader does not map: debug data, symbol tables.

    A file that is not ELF-64 is returned unchanged.
    """
    if not _is_elf(library):
        return library
    (n_names,) = struct.unpack_from("<H", library, 62)
    mapped = _segments(library)
    return _blanked(
        library,
        (
            (section.start, section.stop)
            for number, section in enumerate(_sections(library))
            if number != n_names
            and section.kind not in _NO_BYTES
            and not section.flags & _ALLOC
            and not any(section.start < m.stop and m.start < section.stop for m in mapped)
        ),
    )


def without_networks(library: bytes, kept: str) -> bytes:
    """Open Image Denoise's core with all networks blanked but one, by name ("rt_hdr").

    A filter that needs another one then fails with "invalid or corrupted weights blob".
    Raises ValueError if the networks are not found in the library.
    """
    networks = _networks(library)
    if kept not in networks:
        raise ValueError(f"no network {kept} among {len(networks)} in the library")
    return _blanked(library, (place for name, place in networks.items() if name != kept))


def _networks(library: bytes) -> dict[str, tuple[int, int]]:
    """Name of a network -> (start, stop) in the file, from the library's exported symbols."""
    if not _is_elf(library):
        raise ValueError("no ELF-64 file")
    sections, segments = _sections(library), _segments(library)
    networks = {}
    for table in (s for s in sections if s.kind == _DYNSYM):
        names = sections[table.link].start
        for name_at, _info, _other, _section, address, size in struct.iter_unpack(
            "<IBBHQQ", library[table.start : table.stop]
        ):
            name_place = names + name_at
            symbol = library[name_place : library.index(b"\0", name_place)].decode()
            if symbol.startswith(_NETWORK):
                # 6rt_hdrE: the length of a name, and the name.
                name = symbol.removeprefix(_NETWORK).lstrip("0123456789").removesuffix("E")
                networks[name] = _place(segments, address, size)
    for name, (start, stop) in networks.items():
        if stop <= start or library[start : start + 2] != _TZA_MAGIC:
            raise ValueError(f"no network where its symbol says {name} is")
    return networks


def _place(segments: list[Segment], address: int, size: int) -> tuple[int, int]:
    """(start, stop) in the file of the data at an address; ValueError if no segment holds it."""
    for segment in segments:
        start = segment.start + address - segment.address
        if segment.start <= start and start + size <= segment.stop:
            return start, start + size
    raise ValueError(f"no part of the file is mapped to {address:#x}")


def _is_elf(library: bytes) -> bool:
    """True for a little-endian 64-bit ELF file."""
    return library[:6] == b"\x7fELF\x02\x01" and len(library) >= 64


def _sections(library: bytes) -> list[Section]:
    """The section header table."""
    (start,) = struct.unpack_from("<Q", library, 40)
    each, n = struct.unpack_from("<HH", library, 58)
    rows = (struct.unpack_from("<IIQQQQI", library, start + i * each) for i in range(n))
    return [
        Section(kind, flags, first, first + size, link)
        for _, kind, flags, _, first, size, link in rows
    ]


def _segments(library: bytes) -> list[Segment]:
    """The segments that the loader maps."""
    (start,) = struct.unpack_from("<Q", library, 32)
    each, n = struct.unpack_from("<HH", library, 54)
    rows = (struct.unpack_from("<IIQQQQ", library, start + i * each) for i in range(n))
    return [
        Segment(first, first + size, address)
        for kind, _, first, address, _, size in rows
        if kind == _LOAD
    ]


def _blanked(library: bytes, places: Iterable[tuple[int, int]]) -> bytes:
    """The same bytes with zeros in the ranges (start, stop)."""
    cut = bytearray(library)
    for start, stop in places:
        cut[start:stop] = bytes(stop - start)
    return bytes(cut)
