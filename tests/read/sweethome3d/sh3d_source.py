"""Sweet Home 3D homes for tests, written in code."""

from __future__ import annotations

import io
import zipfile

BOX_OBJ = b"""
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
usemtl white
f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 4 1 5 8
"""

WEDGE_OBJ = b"""
v -1 0 0\nv 3 0 0\nv -1 1 0\nv -1 0 2\nv 3 0 2\nv -1 1 2
g wedge
usemtl redwood
f 1 3 2\nf 4 5 6\nf 1 2 5 4\nf 1 4 6 3\nf 2 3 6 5
"""
"""A wedge 4 wide, 1 high, 2 deep: high at the left, with a thin edge at the right."""

WINDOW_OBJ = b"""
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 .1\nv 1 0 .1\nv 1 1 .1\nv 0 1 .1
g frame
usemtl white
f 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 4 1 5 8
g sweethome3d_window_pane_on_hinge_1
usemtl white
f 5 6 7 8
"""

ROOM = """
<room name='Hall'><point x='5' y='5'/><point x='395' y='5'/><point x='395' y='295'/><point x='5' y='295'/></room>
"""

WALLS = """
<wall id='a' wallAtStart='d' wallAtEnd='b' xStart='0' yStart='0' xEnd='400' yEnd='0' thickness='10'/>
<wall id='b' wallAtStart='a' wallAtEnd='c' xStart='400' yStart='0' xEnd='400' yEnd='300' thickness='10'/>
<wall id='c' wallAtStart='b' wallAtEnd='d' xStart='400' yStart='300' xEnd='0' yEnd='300' thickness='10'/>
<wall id='d' wallAtStart='c' wallAtEnd='a' xStart='0' yStart='300' xEnd='0' yEnd='0' thickness='10'/>
"""


def home_xml(body: str, attributes: str = "wallHeight='250'", *, room: str = ROOM) -> bytes:
    """A Home.xml with one room."""
    return f"<?xml version='1.0'?><home version='7200' {attributes}>{room}{body}</home>".encode()


def sh3d(xml: bytes, contents: dict[str, bytes] | None = None) -> bytes:
    """A .sh3d archive; the same bytes at any time, since the home's number and cameras follow them."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in {"Home.xml": xml, **(contents or {})}.items():
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def piece(attributes: str, inner: str = "", tag: str = "pieceOfFurniture") -> str:
    """A piece 200 x 100 x 50 cm at (150, 100) unless attributes say otherwise."""
    attribute_values = {
        "name": "Thing",
        "model": "1",
        "x": "150",
        "y": "100",
        "width": "200",
        "depth": "100",
        "height": "50",
    }
    rest = "".join(
        f" {k}='{v}'" for k, v in attribute_values.items() if f" {k}=" not in f" {attributes}"
    )
    return f"<{tag} {attributes}{rest}>{inner}</{tag}>"
