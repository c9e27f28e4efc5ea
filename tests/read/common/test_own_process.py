"""Reading in a child process."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.crash_notes import set_watched
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.read.common.format import GivenFile
from pbrs_farm.read.common.own_process import read_apart

GIVEN, FIELDS = GivenFile(Path("a.ifc"), part=str(os.getpid())), ReadFields()


def read_home(given: GivenFile, fields: ReadFields) -> House:
    """The built-in home; fails in the process that asks."""
    assert fields == FIELDS
    house = builtin_home()
    assert given.part != str(os.getpid())
    return house


def refuse(given: GivenFile, _fields: ReadFields) -> House:
    raise BadHouse(given.path, "row 7", "is empty", hint="export it again")


def crash(_given: GivenFile, _fields: ReadFields) -> House:
    os.kill(os.getpid(), signal.SIGSEGV)
    raise AssertionError


@pytest.fixture(autouse=True)
def unwatched() -> Iterator[None]:
    set_watched(False)
    yield
    set_watched()


def test_the_house_of_a_child_has_the_same_bits() -> None:
    house = read_apart(f"{__name__}:read_home", GIVEN, FIELDS)
    assert bundle_from_house(house) == bundle_from_house(builtin_home())


def test_an_error_of_the_reader_is_raised_in_the_parent() -> None:
    with pytest.raises(BadHouse, match="row 7: is empty") as caught:
        read_apart(f"{__name__}:refuse", GIVEN, FIELDS)
    assert caught.value.hint == "export it again"


def test_a_crash_of_the_library_is_one_error_about_the_file() -> None:
    with pytest.raises(BadHouse, match=r"^a\.ifc: damaged: it crashes the library"):
        read_apart(f"{__name__}:crash", GIVEN, FIELDS)


def test_a_process_that_is_watched_reads_without_a_child() -> None:
    set_watched()
    with pytest.raises(AssertionError):
        read_apart(f"{__name__}:read_home", GIVEN, FIELDS)
