"""Sound homes of every format in code, to be damaged by other modules. Effect: sound_home and suncg write files."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tests.read.gltf.gltf_scenes import Scene, two_rooms
from tests.read.suncg.suncg_root import HOUSE, write_root
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, WALLS, home_xml, piece, sh3d

Edit = Callable[[Any], Any]


def chair(number: int, x: float, y: float, height: float = 60.0, more: str = "") -> str:
    """A chair of 60 x 60 cm at (x, y) cm."""
    name = "" if "name=" in more else "name='Chair'"
    return piece(
        f"id='{number}' catalogId='eTeks#chair' {name} x='{x}' y='{y}'"
        f" width='60' depth='60' height='{height}' {more}"
    )


CHAIRS = chair(1, 80, 70, 50) + chair(2, 320, 70, 90) + chair(3, 80, 230, 70) + chair(4, 320, 240)
XML = home_xml(WALLS + CHAIRS)
MODELS = {"1": BOX_OBJ}


def archive(
    body: str = WALLS + CHAIRS, contents: Mapping[str, bytes] | None = None, **more: str
) -> bytes:
    """A .sh3d with this XML body; contents are added to the box model."""
    return sh3d(home_xml(body, **more), MODELS | dict(contents or {}))


def sound_home(folder: Path) -> Path:
    """Write the sound home; returns its path."""
    folder.mkdir()
    path = folder / "sound.sh3d"
    path.write_bytes(archive())
    return path


def scene() -> Scene:
    """The two rooms with four chairs."""
    s = two_rooms()
    for k, (x, z) in enumerate([(1, 1), (3, 2), (5, 1), (5, 2)]):
        low, high = [x - 0.3, 0.0, z - 0.3], [x + 0.3, 0.7, z + 0.3]
        s.node(f"chair_{k}", mesh=s.box(low, high))
    return s


def glb(edit: Edit = lambda _document: None, of: Scene | None = None) -> bytes:
    """A scene's GLB after an edit of its JSON, in place or by replacement with the returned value."""
    document, binary = parts_of_glb((of or scene()).glb())
    changed = edit(document)
    text = json.dumps(document if changed is None else changed).encode()
    return glb_of_parts(text, binary)


def parts_of_glb(data: bytes) -> tuple[dict[str, Any], bytes]:
    """(document, binary chunk)."""
    n = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20 : 20 + n]), data[28 + n :]


def glb_of_parts(text: bytes, binary: bytes) -> bytes:
    """A GLB of any JSON text and a binary chunk."""
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def suncg(folder: Path, edit: Edit = lambda _house: None) -> Path:
    """Write a SUNCG root below folder, with its house.json edited in place; returns the house's folder."""
    root = folder / "bad_root"
    write_root(root)
    path = root / "house" / HOUSE / "house.json"
    house = json.loads(path.read_text())
    changed = edit(house)
    path.write_text(json.dumps(house if changed is None else changed))
    return path.parent


def png(width: int, height: int, rows: bytes | None = None) -> bytes:
    """A PNG that claims a size; rows: its raw pixels, black by default."""
    packed = _packed_zeros(height * (1 + 3 * width)) if rows is None else zlib.compress(rows, 1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        check = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def _packed_zeros(n: int) -> bytes:
    """n zeros as a zlib stream: a piece is compressed once and repeated, since a gigabyte takes seconds."""
    n_piece = 2**20
    pack = zlib.compressobj(wbits=-zlib.MAX_WBITS)
    piece = pack.compress(bytes(n_piece)) + pack.flush(zlib.Z_FULL_FLUSH)
    end = pack.compress(bytes(n % n_piece)) + pack.flush()
    checksum = (n % 65521) << 16 | 1  # adler32
    return b"\x78\x9c" + piece * (n // n_piece) + end + struct.pack(">I", checksum)


def zip_of(entries: Mapping[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """A zip archive."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method, compresslevel=1) as file:
        for name, data in entries.items():
            file.writestr(name, data)
    return stream.getvalue()
