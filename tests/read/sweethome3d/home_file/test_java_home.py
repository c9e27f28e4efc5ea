"""Homes with the program's serialised objects and no XML, as versions before 5.3 wrote them.

Sweet Home 3D 7.0.2 wrote java_home.bin from JAVA_HOME_XML (record_java_home.py).
"""

from __future__ import annotations

import contextlib
import io
import random
import struct
import time
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.sweethome3d.home import read_home
from pbrs_farm.read.sweethome3d.home_file.container import open_container
from pbrs_farm.read.sweethome3d.home_file.home_xml import HomePlan, HomeRoom
from pbrs_farm.read.sweethome3d.home_file.java_home import JavaStreamError, java_objects
from pbrs_farm.read.sweethome3d.home_file.parse_home import parse_plan
from tests.read.sweethome3d.home_file.record_java_home import JAVA_HOME_XML, RECORD
from tests.read.sweethome3d.sh3d_source import BOX_OBJ

STREAM = RECORD.read_bytes()
HEAD = b"\xac\xed\x00\x05"


def old_home(stream: bytes) -> bytes:
    """A .sh3d without Home.xml."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("Home", stream)
        archive.writestr("0/chair.obj", BOX_OBJ)
        archive.writestr("1/chair.obj", BOX_OBJ)
    return data.getvalue()


def plan_of(data: bytes) -> HomePlan:
    return parse_plan(open_container(data, "home.sh3d", None).root, "home.sh3d", 1000)


def test_the_serialised_home_equals_its_xml() -> None:
    java, xml = plan_of(old_home(STREAM)), plan_of(JAVA_HOME_XML)
    assert java.properties["Author"] == "Éva 😀"
    for name in ("wall_height", "levels", "walls", "cameras"):
        assert getattr(java, name) == getattr(xml, name)
    named = [replace(p, model="") for p in java.pieces]
    assert named == [replace(p, model="") for p in xml.pieces]
    assert {p.model.rpartition("/")[2] for p in java.pieces} == {"chair.obj"}
    (a,), (b,) = java.rooms, xml.rooms
    np.testing.assert_array_equal(a.points, b.points)
    values = [{n: getattr(r, n) for n in HomeRoom.__slots__ if n != "points"} for r in (a, b)]
    assert values[0] == values[1]


def test_a_home_without_xml_becomes_a_house() -> None:
    house = read_home(old_home(STREAM), "old.sh3d")
    assert [room.name for room in house.rooms] == ["Hall"]
    assert {"Chair", "Box", "Door", "Lamp"} <= {item.name for item in house.items}


def test_a_stream_cut_anywhere_is_refused_with_advice() -> None:
    for end in range(4, len(STREAM), 97):
        with pytest.raises(
            BadHouse, match=r"only the binary format of older versions.*save it again"
        ):
            plan_of(old_home(STREAM[:end]))


def test_whatever_the_bytes_the_outcome_is_a_plan_or_a_bad_house() -> None:
    rng = random.Random(0)
    for _ in range(400):
        data = bytearray(STREAM)
        for _ in range(rng.choice([1, 1, 2, 8])):
            data[rng.randrange(4, len(data))] = rng.randrange(256)
        with contextlib.suppress(BadHouse):
            plan_of(old_home(bytes(data)))


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (b"", None),
        (b"\x71\x00\x7e\x00\x07", "was not written"),
        (b"\x74\xff\xff", "are expected"),
        (b"\x7c\x7f" + b"\xff" * 7, "are expected"),
        (b"\x75\x72\x00\x02[F" + bytes(8) + b"\x02\x00\x00\x78\x70\x7f\xff\xff\xff", "elements"),
        (b"\x7d" + bytes(40), "unexpected code 0x7d"),
        (b"\x73\x70", "without a class"),
        (b"\x00", "unexpected code"),
    ],
)
def test_claimed_sizes_are_bounded_by_the_bytes(body: bytes, reason: str | None) -> None:
    if reason is None:
        assert java_objects(HEAD + body) == []
        return
    with pytest.raises(JavaStreamError, match=reason):
        java_objects(HEAD + body)


def test_deep_nesting_takes_no_stack_and_ends() -> None:
    array = b"\x75\x72\x00\x02[L" + bytes(8) + b"\x02\x00\x00\x78\x70\x00\x00\x00\x01"
    again = b"\x75\x71\x00\x7e\x00\x00" + struct.pack(">i", 1)
    assert java_objects(HEAD + array + again * 10_000 + b"\x70")
    start = time.monotonic()
    with pytest.raises(JavaStreamError, match="nested too deep"):
        java_objects(HEAD + array + again * 200_000 + b"\x70")
    assert time.monotonic() - start < 20


def test_what_is_no_home_is_refused() -> None:
    with pytest.raises(BadHouse, match="has no home"):
        plan_of(old_home(HEAD + b"\x74\x00\x01a"))
    with pytest.raises(BadHouse, match="no Java serialisation"):
        plan_of(old_home(b"what"))
