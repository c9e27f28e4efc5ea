"""Damaged OBJ, MTL and textures inside a .sh3d. No effects until written."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Final

from tests.hostile.case import Case, home
from tests.hostile.sound_inputs import CHAIRS, archive, png, zip_of
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, ROOM, WALLS, piece

_FACE: Final = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\n"

_LOSSY: Final = ("missing", "empty", "text", "no_faces", "collada", "studio", "cut", "only_points")
"""Models without any visible part."""


def cases() -> Iterator[Case]:
    """Models, then their materials, then textures."""
    for name, model in _models().items():
        body = WALLS + CHAIRS + piece("id='9' name='Sofa' model='m'", "")
        contents = {} if model is None else {"m": model}
        data = archive(body, contents)
        lossy = name in _LOSSY
        yield home(f"model/{name}", "silence" if lossy else "format", "bad.sh3d", data, lossy=lossy)
    for name, parts in _materials().items():
        body = WALLS + CHAIRS + piece("id='9' name='Sofa' model='m/a.obj'", "")
        contents = {f"m/{k}": v for k, v in parts.items()}
        lossy = name != "sound"
        yield home(f"mtl/{name}", "silence", "bad.sh3d", archive(body, contents), lossy=lossy)
    for name, picture in pictures().items():
        outline = ROOM.replace(
            "<room name='Hall'>",
            "<room name='Hall'><texture attribute='floorTexture' name='t' image='t' width='50' height='50'/>",
        )
        data = archive(WALLS + CHAIRS, {"t": picture}, room=outline)
        lossy = name not in ("grey_16_bit", "gif", "interlaced_name")
        yield home(f"texture/{name}", "silence", "bad.sh3d", data, lossy=lossy)


def _models() -> dict[str, bytes | None]:
    return {
        "missing": None,
        "empty": b"",
        "text": b"this is not a model\n" * 50,
        "cut": zip_of({"a.obj": BOX_OBJ})[:60],
        "collada": b"<?xml version='1.0'?><COLLADA><library_geometries/></COLLADA>",
        "studio": b"\x4d\x4d" + struct.pack("<I", 2**31) + b"\x02\0" * 40,
        "no_faces": _FACE,
        "only_points": _FACE + b"p 1 2 3\nl 1 2 3\n",
        "one_face_off": BOX_OBJ + b"f 1 2 999\n",
        "index_0": BOX_OBJ + b"f 0 1 2\n",
        "index_minus": BOX_OBJ + b"f -1 -2 -999\n",
        "index_huge": BOX_OBJ + b"f 1 2 99999999999999999999\n",
        "index_word": BOX_OBJ + b"f one two three\n",
        "index_slashes": BOX_OBJ + b"f 1///1 2//// 3/\n",
        "nan": BOX_OBJ + b"v nan nan nan\nf 1 2 9\n",
        "inf": BOX_OBJ + b"v inf 0 0\nf 1 2 9\n",
        "huge": BOX_OBJ + b"v 1e308 1e308 -1e308\nf 1 2 9\n",
        "beyond_double": BOX_OBJ + b"v 1e999 0 0\nf 1 2 9\n",
        "tiny": b"v 0 0 0\nv 1e-300 0 0\nv 0 1e-300 0\nf 1 2 3\n",
        "flat": b"v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n",
        "no_area": b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 1\n",
        "two_numbers": BOX_OBJ + b"v 1 2\nf 1 2 9\n",
        "face_of_50_000": _polygon(50_000),
        "face_crossing": _polygon(400, crossing=True),
        "faces_of_7": b"".join(
            b"v %g %g 0\n" % (k, k * k % 7) for k in range(7)
        ) + b"f 1 2 3 4 5 6 7\n",
        "long_line": BOX_OBJ + b"# " + b"x" * 5_000_000 + b"\n",
        "continued": BOX_OBJ + b"f 1 \\\n2 \\\n3 \\\n" + b"\\\n" * 100_000,
        "nul": BOX_OBJ.replace(b"usemtl", b"\0usemtl"),
        "not_utf8": BOX_OBJ.replace(b"white", b"wei\xdf"),
        "carriage_returns": BOX_OBJ.replace(b"\n", b"\r"),
        "many_groups": BOX_OBJ + b"".join(b"g a%d\nusemtl b%d\nf 1 2 3\n" % (k, k) for k in range(9000)),
        "curve": BOX_OBJ + b"curv 0 1 1 2\nsurf 0 1 0 1 1 2\nend\n",
        "million_faces": BOX_OBJ + b"f 1 2 3\n" * 1_000_000,
    }  # fmt: skip


def _polygon(n: int, *, crossing: bool = False) -> bytes:
    """A face of n corners, on a curve or jumping across itself."""
    step = n // 2 - 1 if crossing else 1
    order = [k * step % n for k in range(n)]
    lines = [f"v {(k % 100) / 100} {k / n} {(k * k % 101) / 100}" for k in order]
    return ("\n".join(lines) + "\nf " + " ".join(str(k + 1) for k in range(n)) + "\n").encode()


def _materials() -> dict[str, dict[str, bytes]]:
    obj = b"mtllib a.mtl\n" + BOX_OBJ.replace(b"white", b"paint")
    textured = obj.replace(b"f 4 3 2 1", b"vt 0 0\nvt 1 0\nvt 1 1\nf 4/1 3/2 2/3 1/1")
    picture = b"newmtl paint\nKd 1 1 1\nmap_Kd a.png\n"
    return {
        "sound": {"a.obj": textured, "a.mtl": picture, "a.png": png(4, 4)},
        "missing": {"a.obj": obj},
        "empty": {"a.obj": obj, "a.mtl": b""},
        "noise": {"a.obj": obj, "a.mtl": bytes(range(256)) * 20},
        "other_names": {"a.obj": obj, "a.mtl": b"newmtl other\nKd 1 0 0\n"},
        "nan": {"a.obj": obj, "a.mtl": b"newmtl paint\nKd nan nan nan\nNs inf\nd nan\n"},
        "huge": {"a.obj": obj, "a.mtl": b"newmtl paint\nKd 1e300 -5 2\nNs 1e300\nd 7\nillum 99999999999\n"},
        "words": {"a.obj": obj, "a.mtl": b"newmtl paint\nKd red green blue\nd\nmap_Kd\n"},
        "picture_missing": {"a.obj": textured, "a.mtl": picture},
        "picture_empty": {"a.obj": textured, "a.mtl": picture, "a.png": b""},
        "picture_cut": {"a.obj": textured, "a.mtl": picture, "a.png": png(64, 64)[:60]},
        "picture_path": {"a.obj": textured, "a.mtl": picture.replace(b"a.png", b"../../../etc/passwd")},
        "obj_as_mtl": {"a.obj": obj, "a.mtl": obj},
    }  # fmt: skip


def pictures() -> dict[str, bytes]:
    """Fault -> a damaged picture."""
    sound = png(32, 32)
    damaged = bytearray(sound)
    damaged[45:60] = b"\xff" * 15
    return {
        "empty": b"",
        "text": b"no picture at all",
        "cut": sound[: len(sound) // 2],
        "header_only": sound[:33],
        "noise_inside": bytes(damaged),
        "claims_60000": png(60_000, 60_000, b""),
        "claims_0": png(0, 0, b""),
        "claims_minus": png(2**31 - 1, 1, b""),
        "bomb_20000": png(20_000, 20_000),
        "jpeg_cut": b"\xff\xd8\xff\xe0\x00\x10JFIF\x00" + b"\x01" * 20,
        "svg": b"<svg xmlns='http://www.w3.org/2000/svg'><rect width='9' height='9'/></svg>",
        "exr_noise": b"\x76\x2f\x31\x01\x02\0\0\0" + b"\xff" * 200,
        "hdr_claims": b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 99999 +X 99999\n\x02\x02",
        "gif": b"GIF89a\x01\0\x01\0\x80\0\0\xff\xff\xff\0\0\0,\0\0\0\0\x01\0\x01\0\0\x02\x02D\x01\0;",
    }
