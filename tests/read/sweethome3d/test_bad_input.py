"""For any bytes a reader returns a House or raises a BadHouse that names the place."""

from __future__ import annotations

import contextlib
import io
import struct
import zipfile
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.sweethome3d.door_cutouts import polygons_from_path
from pbrs_farm.read.sweethome3d.home import read_home
from tests.hypothesis_profiles import examples
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, ROOM, WALLS, home_xml, piece, sh3d

EXAMPLES = examples(50)
LAMP = "<lightSource x='0.5' y='0.5' z='0.5' color='00FFFFFF' diameter='0.1'/>"
DOOR = piece(
    "x='200' y='0' depth='20' height='200' cutOutShape='M0,0 v1 h1 v-1 z'", tag="doorOrWindow"
)
TEXTURE = "<texture name='T' width='20' height='20' angle='1' scale='2' xOffset='.1' image='t'/>"
MOVED = "<transformation name='sweethome3d_hinge_1' matrix='1 0 0 0 0 1 0 0 0 0 1 0'/>"
STAIRS = piece("height='250' staircaseCutOutShape='M0,0 v1 h1 v-1 z' pitch='.1'", TEXTURE + MOVED)
SLOPED = (
    "<wall id='s' xStart='0' yStart='150' xEnd='400' yEnd='150' thickness='10' heightAtEnd='100'"
    " arcExtent='0.5'><baseboard attribute='leftSideBaseboard' thickness='1' height='7'/></wall>"
)
FULL = (
    SLOPED
    + STAIRS
    + WALLS
    + piece("catalogId='eTeks#bed'")
    + piece("power='0.5'", LAMP, tag="light")
    + DOOR
)


def refused(data: bytes, match: str, fields: ReadFields | None = None) -> None:
    with pytest.raises(BadHouse, match=match) as caught:
        read_home(data, "folder/my home.sh3d", fields=fields)
    assert str(caught.value).startswith("my home.sh3d")


def test_a_home_with_only_hidden_levels_explains_how_to_read_them() -> None:
    level = "<level id='0' elevation='0' floorThickness='12' height='250' viewable='false'/>"
    room = ROOM.replace("<room ", "<room level='0' ")
    refused(sh3d(home_xml(level, room=room)), "read.hidden_levels")


@pytest.mark.parametrize("data", [b"", b"hello", b"\x00" * 100, b"%PDF-1.4"])
def test_a_file_that_is_no_home_is_refused(data: bytes) -> None:
    refused(data, "neither a .sh3d archive")


def test_a_truncated_zip_is_refused() -> None:
    whole = sh3d(home_xml(FULL), {"1": BOX_OBJ * 50})
    for cut in (10, len(whole) // 2, len(whole) - 5):
        refused(whole[:cut], "damaged zip")


def test_a_damaged_entry_is_refused_by_name() -> None:
    whole = bytearray(sh3d(home_xml(FULL)))
    start = whole.find(b"Home.xml") + 40
    whole[start : start + 40] = b"\xaa" * 40
    refused(bytes(whole), "Home.xml")


def test_a_home_without_home_xml_explains_how_to_save_it_again() -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("Home", b"\xac\xed")
    refused(stream.getvalue(), r"Home\.xml.*Sweet Home 3D 5\.3 or later")


def test_names_that_leave_the_archive_are_refused() -> None:
    for name in ("../evil", "a/../../b", "/etc/passwd", "a\\..\\b"):
        refused(sh3d(home_xml(FULL), {name: b"x"}), "leaves the archive")


def test_an_entry_without_a_name_is_ignored() -> None:
    sound = sh3d(home_xml(WALLS), {"1": BOX_OBJ})
    stream = io.BytesIO(sound)
    nameless = zipfile.ZipInfo("x")
    nameless.filename = ""
    with zipfile.ZipFile(stream, "a") as archive:
        archive.writestr(nameless, b"")
    assert len(read_home(stream.getvalue(), "home.sh3d").rooms) == len(
        read_home(sound, "home.sh3d").rooms
    )


def test_a_zip_bomb_is_refused_without_unpacking_it() -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Home.xml", home_xml(FULL))
        archive.writestr("bomb", b"x")
    data = stream.getvalue()
    start = data.rfind(b"PK\x01\x02")
    # The zip directory claims 3 GB.
    refused(data[: start + 24] + struct.pack("<I", 3 * 2**30) + data[start + 28 :], "unpacks to")


def test_an_entry_larger_than_declared_is_refused() -> None:
    xml = home_xml(FULL)
    data = bytearray(sh3d(xml))
    small = struct.pack("<I", 100)
    start = data.rfind(b"PK\x01\x02")
    data[start + 24 : start + 28] = small
    data[start + 16 : start + 20] = struct.pack("<I", zlib.crc32(xml[:100]))
    refused(bytes(data), "Home.xml")


@pytest.mark.parametrize(
    "head",
    [
        "<!DOCTYPE home [<!ENTITY a 'x'>]>",
        "<!DOCTYPE home [<!ENTITY a SYSTEM 'file:///etc/passwd'>]>",
        "<!DOCTYPE home [<!ENTITY % a SYSTEM 'http://127.0.0.1/x'> %a;]>",
        "<!DOCTYPE h [<!ENTITY a 'xx'><!ENTITY b '&a;&a;&a;'><!ENTITY c '&b;&b;&b;'>]>",
    ],
)
def test_entities_are_refused_unexpanded(head: str) -> None:
    xml = f"<?xml version='1.0'?>{head}<home name='&a;'>{ROOM}</home>".encode()
    refused(xml, "entity definitions|not well-formed")
    refused(sh3d(xml), "entity definitions|not well-formed")


@pytest.mark.parametrize(
    ("xml", "match"),
    [
        (b"<home><room></home>", "not well-formed"),
        ("<home name='\xe9'>".encode("latin-1") + b"</home>", "not well-formed"),
        (b"<house/>", "not <home>"),
        (b"<home>" + b"<a>" * 300 + b"</a>" * 300 + b"</home>", "nested deeper"),
        (home_xml(WALLS.partition("<wall id='d'")[0], room=""), "no rooms"),
        (b"<home/>", "no rooms"),
    ],
)
def test_xml_that_is_no_home_is_refused(xml: bytes, match: str) -> None:
    refused(xml, match)


@pytest.mark.parametrize(
    ("body", "place"),
    [
        (WALLS.replace("xStart='400'", "xStart='nan'", 1), "wall b"),
        (WALLS.replace("thickness='10'", "thickness='inf'", 1), "wall a"),
        (WALLS.replace("thickness='10'", "thickness='-4'", 1), "wall a"),
        (WALLS.replace("xEnd='400' ", "", 1), "wall a: attribute xEnd is missing"),
        (piece("angle='NaN'"), "Thing.*angle"),
        (piece("x='1000000000'"), "Thing.*x is 10000000 m, farther than 1000 m"),
        (piece("x='1000001'"), "farther than"),
        (piece("width='1e300'"), "farther than"),
        (piece("color='red'"), "colour"),
        (piece("modelRotation='1 0 0'"), "9 finite numbers"),
        (piece("power='x'", LAMP, tag="light"), "power"),
    ],
)
def test_a_number_that_makes_no_sense_is_refused_with_its_element(body: str, place: str) -> None:
    refused(sh3d(home_xml(body), {"1": BOX_OBJ}), place)


def test_a_missing_or_foreign_model_is_noted_and_the_rest_is_read() -> None:
    body = piece("model='9'") + piece("model='2' name='Scan'") + piece("model='3'") + piece("")
    contents = {"1": BOX_OBJ, "2": b"<?xml version='1.0'?><COLLADA/>", "3": b"v 0 0 0\nf 1 2 3\n"}
    house = read_home(sh3d(home_xml(body), contents), "h.sh3d")
    kinds = {n.kind for n in house.notes}
    assert {"missing-model", "unsupported-model", "unreadable-model"} <= kinds
    assert [i.id for i in house.items if i.id.startswith("piece")] == ["piece_3"]
    assert any("Scan" in n.place and "Collada" in n.text for n in house.notes)


def test_a_home_without_any_of_its_models_is_refused() -> None:
    refused(home_xml(piece("")), "none of its 1 models")


def test_strict_reading_makes_the_first_note_an_error() -> None:
    data = sh3d(home_xml(piece("") + piece("model='9'")), {"1": BOX_OBJ})
    refused(data, "Thing.*missing-model", ReadFields(strict=True))


def test_too_many_triangles_are_refused_with_the_limit() -> None:
    data = sh3d(home_xml(piece("") * 3), {"1": BOX_OBJ})
    refused(data, "more than 30 triangles.*read.max_triangles", ReadFields(max_triangles=30))
    refused(data, "6 triangles or more, at most 5", ReadFields(max_model_triangles=5))


@pytest.mark.parametrize(
    "path",
    ["", "z", "M0,0", "L1,1", "M0,0 v1 h1 v-1 z" * 10000, "M0,0 q", "M0,0 X1", "M0,0 L1e999,0",
     "M0 0 a1 1 0 0", "M0,0 v1 h1 v-1 z; drop", "M" + "0" * 90000],
)  # fmt: skip
def test_a_cut_out_that_is_no_shape_is_cut_as_a_rectangle(path: str) -> None:
    body = WALLS + DOOR.replace("M0,0 v1 h1 v-1 z", path)
    house = read_home(sh3d(home_xml(body), {"1": BOX_OBJ}), "h.sh3d")
    low, high = (f(house.openings[0].cutter.positions, axis=0) for f in (np.min, np.max))
    assert high[1] - low[1] == pytest.approx(2.0, abs=1e-5)


def test_a_path_that_never_ends_stops_at_a_limit() -> None:
    with pytest.raises(ValueError, match="at most"):
        polygons_from_path("M0,0 " + "l1,1 " * 50_000)
    with pytest.raises(ValueError, match="points"):
        polygons_from_path("M0,0 " + "a1e5,1e5 0 1,1 1,0 " * 4000)
    with pytest.raises(ValueError, match="closes"):
        polygons_from_path("M0,0" + "z" * 90_000)


@pytest.mark.parametrize(
    "path",
    ["M0 0" + "." * 90_000, "M0 0" + "e" * 90_000,
     "M0 0A1e-300 1 0 0 1 1 0", "M0 0L1e999 0 1 1z", "M0 0A1e308 1e308 0 0 1 1 1z",
     "M0 0L2000000 0 1 1z", "M0 0 nan 1 1z", "M0 0 A1 1 0 2 1 1 1z"],
)  # fmt: skip
def test_a_hostile_path_gives_no_shape(path: str) -> None:
    polygons: tuple[object, ...] = ()
    with contextlib.suppress(ValueError):
        polygons = polygons_from_path(path)
    assert polygons == ()


def test_the_same_bytes_give_the_same_house() -> None:
    data = sh3d(home_xml(FULL), {"1": BOX_OBJ})
    a, b = read_home(data, "h.sh3d"), read_home(data, "h.sh3d")
    assert a.id == b.id
    assert a.materials == b.materials
    assert [i.id for i in a.items] == [i.id for i in b.items]
    for x, y in zip(a.items, b.items, strict=True):
        assert x.lights == y.lights
        for s, t in zip(x.surfaces, y.surfaces, strict=True):
            assert s.positions.tobytes() == t.positions.tobytes()
            assert s.faces.tobytes() == t.faces.tobytes()


def check(house: House) -> None:
    for item in house.items:
        for s in item.surfaces:
            assert np.isfinite(s.positions).all()
            assert len(s.faces) == 0 or s.faces.max() < len(s.positions)
            assert 0 <= s.material < len(house.materials)
            assert s.uvs is None or np.isfinite(s.uvs).all()
            assert s.normals is None or np.isfinite(s.normals).all()
    for opening in house.openings:
        assert np.isfinite(opening.cutter.positions).all()


def outcome(data: bytes) -> House | str:
    try:
        return read_home(data, "fuzz.sh3d")
    except BadHouse as error:
        return str(error)


def read_or_refuse(data: bytes) -> None:
    result = outcome(data)
    if isinstance(result, str):
        assert result.startswith("fuzz.sh3d")
    else:
        check(result)


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.binary(max_size=300))
def test_any_bytes_end_in_a_house_or_a_refusal(data: bytes) -> None:
    read_or_refuse(data)
    read_or_refuse(b"PK\x03\x04" + data)
    read_or_refuse(b"<home>" + data + b"</home>")


_WHOLE = sh3d(home_xml(FULL), {"1": BOX_OBJ})


@settings(max_examples=EXAMPLES, deadline=None)
@given(st.integers(0, len(_WHOLE) - 1), st.binary(min_size=1, max_size=4))
def test_a_home_with_bytes_changed_ends_in_a_house_or_a_refusal(at: int, put: bytes) -> None:
    read_or_refuse(_WHOLE[:at] + put + _WHOLE[at + len(put) :])


_NUMBERS = st.one_of(
    st.floats(allow_nan=False, width=32).map(repr),
    st.sampled_from(["0", "-0", "1e-30", "1e5", "nan", "-1", "", "x", "1e400", "99999"]),
)
_NAMES = ["xStart", "yStart", "xEnd", "yEnd", "thickness", "height", "heightAtEnd", "arcExtent",
          "x", "y", "angle", "pitch", "roll", "width", "depth", "elevation", "power", "diameter"]  # fmt: skip


@settings(max_examples=EXAMPLES, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 60), _NUMBERS, st.sampled_from(_NAMES)), max_size=6))
def test_a_home_with_numbers_changed_ends_in_a_house_or_a_refusal(
    changes: list[tuple[int, str, str]],
) -> None:
    from xml.etree import ElementTree

    root = ElementTree.fromstring(home_xml(FULL))
    elements = list(root.iter())
    for where, number, name in changes:
        elements[where % len(elements)].set(name, number)
    read_or_refuse(sh3d(ElementTree.tostring(root), {"1": BOX_OBJ}))


@settings(max_examples=EXAMPLES, deadline=None)
@given(
    st.lists(
        st.sampled_from(
            ["v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 0 1e38", "v 1e-40 0 1", "vt 0 0", "vn 0 0 0",
             "vn 0 0 1", "f 1 2 3", "f 3 2 1 4", "f -1 -2 -3", "f 1/1/1 2/1/1 3/1/1", "f 1//1 2//1 3",
             "g a", "usemtl b", "s off", "f 1 1 1", "f", "v", "f 1 2", "mtllib x.mtl", "\\", "f 1 2 3 4 5"]
        ),
        max_size=25,
    )
)  # fmt: skip
def test_any_model_ends_in_a_house_or_a_refusal(lines: list[str]) -> None:
    read_or_refuse(sh3d(home_xml(piece("") + piece("pitch='1'")), {"1": "\n".join(lines).encode()}))


_TOKENS = st.sampled_from(
    ["M0,0 ", "m.1.1", "l1,1", "v1", "h1", "z", "a.5,.5 0 1,1 1,0", "A1 0 0 0 0 0 1", "c0,1 1,1 1,0",
     "q1,1 0,1", "s1,1 0,1", "t.5,.5", " -1 ", "1e9", "Z"]
)  # fmt: skip


@settings(max_examples=EXAMPLES, deadline=None)
@given(st.lists(_TOKENS, max_size=12))
def test_any_cut_out_path_ends_in_a_house(tokens: list[str]) -> None:
    path = "".join(tokens)
    body = WALLS + DOOR.replace("M0,0 v1 h1 v-1 z", path)
    check(read_home(sh3d(home_xml(body), {"1": BOX_OBJ}), "h.sh3d"))


def test_a_room_of_a_hundred_thousand_corners_is_simplified_with_a_note() -> None:
    n = 99_000
    angles = np.arange(n) * 2 * np.pi / n
    corners = "".join(
        f"<point x='{x:.3f}' y='{y:.3f}'/>"
        for x, y in zip(300 + 250 * np.cos(angles), 300 + 250 * np.sin(angles), strict=True)
    )
    data = sh3d(home_xml(WALLS, room=f"<room name='Round'>{corners}</room>"))
    house = read_home(data, "round.sh3d", fields=ReadFields())
    (room,) = house.rooms
    assert 50 < len(room.polygon) <= 300
    assert any(n.kind == "room-simplified" and "99000 corners" in n.text for n in house.notes)
