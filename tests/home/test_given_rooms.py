"""The room words of other formats."""

from __future__ import annotations

import csv
from importlib.resources import files

import pytest

from pbrs_farm.home.given_rooms import NO_ROOM, given_room
from pbrs_farm.home.room_use import named_kind


@pytest.mark.parametrize("name", ["MasterBedroom", "master bedroom", "MASTER_BEDROOM"])
def test_a_room_word_is_found_in_any_case_and_spelling(name: str) -> None:
    assert given_room("3dfront", name) == "bedroom"
    assert given_room("3dfront", "OtherRoom") == NO_ROOM
    assert given_room("3dfront", "Xyzzy") is None


def test_every_type_of_the_table_is_a_word_with_a_room_use() -> None:
    text = files("pbrs_farm.home").joinpath("given_rooms.csv").read_text("utf-8")
    types = {row["type"] for row in csv.DictReader(text.splitlines())} - {NO_ROOM}
    assert {t for t in types if named_kind(t) is None} <= {"by its fixtures"}
