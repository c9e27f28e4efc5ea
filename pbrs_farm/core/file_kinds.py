"""The kind of a file by its first bytes, for clear messages about a misnamed one; no effects."""

from __future__ import annotations

import re
from pathlib import PurePath
from typing import Final, NamedTuple

HEAD_BYTES: Final = 512
"""Of a file: enough to know it by."""


class FileKind(NamedTuple):
    """A kind of file: its first bytes, its name in messages, and its suffixes."""

    start: re.Pattern[bytes]
    words: str
    suffixes: tuple[str, ...]
    hint: str = ""


def _kind(start: bytes, words: str, suffixes: str = "", hint: str = "") -> FileKind:
    return FileKind(
        re.compile(start, re.DOTALL | re.IGNORECASE), words, tuple(suffixes.split()), hint
    )


_UNPACK: Final = "unpack it"
# fmt: off
_KINDS: Final = (
    _kind(rb"\x89PNG\r\n\x1a\n", "a PNG picture", ".png"),
    _kind(rb"\xff\xd8\xff", "a JPEG picture", ".jpg .jpeg .jpe"),
    _kind(rb"GIF8[79]a", "a GIF picture", ".gif"),
    _kind(rb"II\*\0|MM\0\*", "a TIFF picture", ".tif .tiff .dng .nef .cr2 .arw"),
    _kind(rb"RIFF.{4}WEBP", "a WebP picture", ".webp"),
    _kind(rb".{4}ftyp(heic|heix|mif1|avif)", "a HEIF or AVIF picture", ".heic .heif .avif"),
    _kind(rb"\x76\x2f\x31\x01", "an OpenEXR picture", ".exr"),
    _kind(rb"#\?(RADIANCE|RGBE)", "a Radiance HDR picture", ".hdr .pic .rgbe"),
    _kind(rb"\xabKTX 20\xbb", "a KTX2 picture", ".ktx2"),
    _kind(rb"DDS \x7c\0\0\0", "a DDS picture", ".dds"),
    _kind(rb".{4}ftyp|\x1a\x45\xdf\xa3", "a video", ".mp4 .mov .m4v .mkv .webm"),
    _kind(rb"%PDF-", "a PDF document", ".pdf"),
    _kind(rb"PK\x03\x04|PK\x05\x06", "a ZIP archive",
          ".zip .sh3d .sh3f .sh3x .usdz .ifczip .npz .pt .pth .whl .xlsx .docx .kmz", _UNPACK),
    _kind(rb"\x1f\x8b", "a gzip archive", ".gz .tgz .svgz", _UNPACK),
    _kind(rb"7z\xbc\xaf\x27\x1c", "a 7z archive", ".7z", _UNPACK),
    _kind(rb"Rar!\x1a", "a RAR archive", ".rar", _UNPACK),
    _kind(rb"glTF", "a binary glTF scene", ".glb .gltf .vrm"),
    _kind(rb"ISO-10303-21", "an IFC or STEP model", ".ifc .stp .step .p21"),
    _kind(rb"PXR-USDC", "a binary USD layer", ".usdc .usd"),
    _kind(rb"#usda", "a USD layer of text", ".usda .usd"),
    _kind(rb"ply\r?\n", "a PLY mesh", ".ply"),
    _kind(rb"BLENDER", "a Blender file", ".blend"),
    _kind(rb"Kaydara FBX", "an FBX scene", ".fbx"),
    _kind(rb"AC10[0-9]{2}\0", "a DWG drawing", ".dwg"),
    _kind(rb"\x89HDF\r\n\x1a\n", "an HDF5 file", ".h5 .hdf5 .hdf .mat .nc .keras"),
    _kind(rb"MATLAB 5\.0 MAT", "a MATLAB file", ".mat"),
    _kind(rb"\x93NUMPY", "a NumPy array", ".npy"),
    _kind(rb"PAR1", "a Parquet table", ".parquet"),
    _kind(rb"SQLite format 3\0", "an SQLite database", ".db .sqlite .sqlite3"),
    _kind(rb"\x7fELF|MZ.{56}", "a program", ".so .exe .dll .bin"),
    _kind(rb"\s*(<!DOCTYPE html|<html)", "an HTML page", ".html .htm .xhtml",
          "the address that it came from gives a page: fetch the file itself"),
    _kind(rb"version https://git-lfs\.github\.com/spec", "a pointer of Git LFS", "",
          "`git lfs pull` fetches the file"),
)
# fmt: on


def kind_of(data: bytes) -> FileKind | None:
    """The kind of a file by its first HEAD_BYTES; None for text and for unknown kinds."""
    head = data[:HEAD_BYTES].removeprefix(b"\xef\xbb\xbf")
    return next((kind for kind in _KINDS if kind.start.match(head)), None)


def other_kind(data: bytes, name: object) -> FileKind | None:
    """The kind of a file whose name or path says another; None if the name fits, or the kind is unknown."""
    kind, suffix = kind_of(data), PurePath(str(name)).suffix.lower()
    return None if kind is None or suffix in kind.suffixes else kind


def wrong_kind(data: bytes, name: object) -> tuple[str, str]:
    """("is a PNG picture, though named .glb", hint) of an unreadable file; ("", "") if its bytes say nothing."""
    if not data:
        return "is empty", "copy it again"
    kind = other_kind(data, name)
    if kind is None:
        return "", ""
    suffix = PurePath(str(name)).suffix
    return f"is {kind.words}" + (f", though named {suffix}" if suffix else ""), kind.hint
