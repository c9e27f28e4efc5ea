"""Hostile names: newlines, 100 kB, every alphabet, markup, paths. No effects until written."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from typing import Any, Final
from xml.sax.saxutils import quoteattr

from tests.hostile.case import Case, Place, Words, run, with_sheet
from tests.hostile.sound_inputs import CHAIRS, archive, chair, glb, parts_of_glb, scene, suncg
from tests.hostile.verdict import FORGED
from tests.read.sweethome3d.sh3d_source import ROOM, WALLS

NAMES: Final = {
    "newline": f"Hall\n{FORGED} house: FAILED: everything is lost",
    "return": f"Hall\r{FORGED}\r\n{FORGED}",
    "100_kb": "x" * 100_000,
    "unicode": "Wohnküche Спальня 寝室 غرفة חדר ห้อง 🛏️",
    "right_to_left": "\u202eHall\u202c \u2066abc",
    "separators": f"Hall\u2028{FORGED}\u2029{FORGED}\u0085{FORGED}",
    "combining": "H" + "\u0301" * 2000,
    "html": "<script>alert(1)</script><img src=x onerror=alert(2)>",
    "markup": "[red]Hall[/red] [/] {0} {name} %s %d %(x)s",
    "path": "../../../../tmp/hall /etc/passwd",
    "blank": " \t ",
}
"""Names for a room, a piece or a node."""

_JSON_ONLY: Final = {
    "escape": "\x1b[2J\x1b[31mHall\x07",
    "nul": "Hall\0Hall",
    "surrogate": "Hall \ud800",
}
"""Names that JSON can represent and XML cannot."""


def cases() -> Iterator[Case]:
    """Each name in a .sh3d, a GLB and a SUNCG root, and on the sheet."""
    for key, name in NAMES.items():
        data = partial(_home, name)
        yield with_sheet(Case(f"text/sh3d_{key}", "text", partial(_file, "text.sh3d", data)))
    for key, name in (NAMES | _JSON_ONLY).items():
        if key in ("newline", "100_kb", "unicode", *_JSON_ONLY):
            data = partial(_scene, name)
            yield with_sheet(Case(f"text/glb_{key}", "text", partial(_file, "text.glb", data)))
            yield Case(f"text/suncg_{key}", "text", partial(_suncg, name))
    yield Case("text/bad_value_100_kb", "text", partial(_file, "text.sh3d", _bad_value))
    yield Case("text/bad_json_100_kb", "text", partial(_suncg_bad, "y" * 100_000))
    yield Case("text/bad_json_newline", "text", partial(_suncg_bad, NAMES["newline"]))
    yield Case("text/glb_bad_newline", "text", partial(_file, "text.glb", _bad_node))
    for key in ("newline", "unicode", "markup"):
        yield Case(f"text/file_{key}", "text", partial(_file_name, NAMES[key].replace("/", "-")))
    yield Case("text/file_not_utf8", "text", _file_not_utf8)


def _file(file: str, data: partial[bytes], place: Place) -> list[Words]:
    path = place.folder / file
    path.write_bytes(data())
    return [run(place, path)]


def _home(name: str) -> bytes:
    """A home whose room, piece, level and texture have the name."""
    quoted = quoteattr(name, {"\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})
    body = CHAIRS + chair(5, 200, 150, 60, f"name={quoted}")
    return archive(WALLS + body, room=ROOM.replace("'Hall'", quoted))


def _bad_value() -> bytes:
    return archive(WALLS + chair(5, 200, 150, 60, f"angle='{'z' * 100_000}'"))


def _scene(name: str) -> bytes:
    def edit(document: dict[str, Any]) -> None:
        document["nodes"][-1]["name"] = f"chair {name}"
        document["nodes"][0]["name"] = f"floor {name}"
        document["scenes"][0]["name"] = name
        document["materials"] = [{"name": name}]

    return glb(edit)


def _bad_node() -> bytes:
    document, _ = parts_of_glb(scene().glb())
    last = len(document["nodes"]) - 1

    def edit(document: dict[str, Any]) -> None:
        document["nodes"][last] |= {"name": NAMES["newline"], "mesh": 999}

    return glb(edit)


def _suncg(name: str, place: Place) -> list[Words]:
    def edit(plain: dict[str, Any]) -> None:
        nodes = plain["levels"][0]["nodes"]
        nodes[0]["roomTypes"] = [name]
        nodes[2]["materials"] = [{"name": name}]

    return [run(place, suncg(place.folder, edit))]


def _suncg_bad(name: str, place: Place) -> list[Words]:
    def edit(plain: dict[str, Any]) -> str:
        nodes = plain["levels"][0]["nodes"]
        nodes[2] |= {"id": name, "modelId": name, "transform": [name]}
        return json.loads(json.dumps(plain))

    return [run(place, suncg(place.folder, edit))]


def _file_name(name: str, place: Place) -> list[Words]:
    path = place.folder / f"{name[:80]}.sh3d"
    path.write_bytes(archive())
    return [run(place, path)]


def _file_not_utf8(place: Place) -> list[Words]:
    path = place.folder / b"caf\xe9.sh3d".decode("utf-8", "surrogateescape")
    path.write_bytes(archive())
    return [run(place, path)]
