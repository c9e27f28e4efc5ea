"""The table of formats: each is recognised by its file, alone and in a folder, by `run` and `submit`."""

from __future__ import annotations

import codecs
import json
import shlex
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Final

import pytest

from pbrs_farm.commands.arguments import home_arguments
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadHouse, MachineFailed
from pbrs_farm.core.house import House
from pbrs_farm.core.plugins import Plugin
from pbrs_farm.core.recipe import ReadFields, Recipe, recipe_from_name
from pbrs_farm.prepare import formats as table
from pbrs_farm.prepare.finished_house import repaired_house
from pbrs_farm.prepare.formats import (
    format_of_file,
    format_of_kind,
    format_of_plugin,
    format_of_source,
    formats,
    missing_library,
    summary,
)
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve, words_of_homes
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.read.common.format import PLAN
from pbrs_farm.repair.repair_report import RepairReport
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore
from tests.inputs.sound_files import every_format
from workers.client.farm_client import completed, new_spec
from workers.house_files import entries_from_arguments, is_left_in_place, upload
from workers.ids import GEOMETRY, job_key
from workers.node import house_runner
from workers.runner import TaskRequest

WRITERS: Final = every_format()

each_format = pytest.mark.parametrize("title", [one.title for one in formats()])


def test_every_format_of_the_table_is_tried_here() -> None:
    assert {entry.title for entry in formats()} == set(WRITERS)


@pytest.mark.quick(8)
@each_format
def test_a_file_is_recognised_by_its_format_and_read(tmp_path: Path, title: str) -> None:
    path = WRITERS[title](tmp_path)
    entry = format_of_file(path)
    assert entry is not None
    (file_format,) = (row for row in formats() if row.title == title)
    assert entry.kind == file_format.kind
    source = resolve(str(path))
    assert source.kind == file_format.kind
    assert source.given.path == path.resolve()
    assert read_house(source, ReadFields()).rooms


@pytest.mark.quick(8)
@each_format
def test_a_folder_names_its_homes_to_run_and_submit_alike(tmp_path: Path, title: str) -> None:
    path = WRITERS[title](tmp_path)
    folder = path.parent
    (folder / "notes.txt").write_text("no home")
    (folder / "plain.svg").write_text("<svg/>")
    (folder / "table.csv").write_text("a,b\n1,2\n")
    (folder / "home.rooms.json").write_text('{"rooms": []}')
    (folder / ".hidden.sh3d").write_bytes(b"")
    # Both verbs expand a folder through one function; each word is a home that resolves.
    words = home_arguments([str(folder)], None)
    assert str(path) in words
    assert words == words_of_homes(words), "a home stays what it is"
    entries = entries_from_arguments([str(folder)])
    assert [ref.word for _entry, ref in entries] == [resolve(word).word for word in words]


@pytest.mark.quick(8)
@each_format
def test_a_file_travels_to_a_farm_or_is_left_in_place(tmp_path: Path, title: str) -> None:
    path = WRITERS[title](tmp_path)
    ((entry, ref),) = entries_from_arguments([str(path)])
    store = MemoryStore()
    upload(store, [ref])
    placed = SourceRef.model_validate_json(entry.source)
    if is_left_in_place(ref):
        source_format = format_of_source(ref)
        assert source_format is not None
        assert placed == ref
        assert ref.companions or not source_format.travels
    else:
        assert store.get(placed.location) == path.read_bytes()


@pytest.mark.quick(3)
@each_format
def test_run_and_a_worker_of_a_farm_make_the_house_of_a_file(
    tmp_path: Path, title: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Repair of such houses takes a minute, and does not depend on formats.
    monkeypatch.setattr("pbrs_farm.repair.repair", _declared_repaired)
    monkeypatch.setattr(house_runner, "steps_before_views", lambda _spec, _house: ("house",))
    path = WRITERS[title](tmp_path)
    ((entry, ref),) = entries_from_arguments([str(path)])
    recipe = recipe_from_name("preview")
    local, farm = MemoryStore(), MemoryStore()
    run_step("house", Work(local, recipe, ref.house_id, HouseCache(), source=resolve(str(path))))
    # Submit it, and let a worker make it from the files in the store.
    _houses, spec = completed([entry], new_spec(recipe, modes=("opengl_dl",)))
    farm.put(job_key(spec.job_id), spec.model_dump_json().encode())
    upload(farm, [ref])
    request = TaskRequest(
        job_id=spec.job_id, house=entry.house_id, unit="-", stage=GEOMETRY, source=entry.source
    )
    house_runner.HouseRunner(farm, n_threads=1).run(request, lambda _text: None)
    name = keys.house_key(ref.house_id, "house.json")
    assert json.loads(local.get(name))["id"] == ref.house_id
    assert local.get(name) == farm.get(name)


def _declared_repaired(house: House, **_given: object) -> tuple[House, RepairReport]:
    return replace(house, is_repaired=True), RepairReport(house_id=house.id)


@pytest.mark.quick(6)
@each_format
def test_a_byte_order_mark_before_a_text_changes_nothing(tmp_path: Path, title: str) -> None:
    path = WRITERS[title](tmp_path)
    before = _what_is_read(path)
    for file in filter(Path.is_file, tmp_path.rglob("*")):
        if _is_text(file.read_bytes()):
            file.write_bytes(codecs.BOM_UTF8 + file.read_bytes())
    if title == "OpenUSD":
        # The library refuses such a file with a reason.
        with pytest.raises(BadHouse, match="BOM"):
            _what_is_read(path)
        return
    assert _what_is_read(path) == before


def _is_text(data: bytes) -> bool:
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return bool(data) and b"\0" not in data


def _what_is_read(path: Path) -> list[object]:
    house = read_house(resolve(str(path)), ReadFields())
    items = [(i.id, i.name, i.kind, i.nyu40, len(i.surfaces), len(i.lights)) for i in house.items]
    rooms = [(room.id, room.name, room.polygon.tolist()) for room in house.rooms]
    return [items, rooms, house.notes, [(m.kind, m.diffuse) for m in house.materials]]


def test_a_range_and_a_folder_become_one_word_per_home(tmp_path: Path) -> None:
    for name in ("b.glb", "a.sh3d"):
        (tmp_path / name).write_bytes(b"")
    words = words_of_homes(["builtin", "made:2..3", str(tmp_path)])
    homes = [str(tmp_path / name) for name in ("a.sh3d", "b.glb")]
    assert words == ["builtin", "made:2", "made:3", *homes]


def test_a_folder_without_a_home_lists_the_readable_formats(tmp_path: Path) -> None:
    assert words_of_homes([str(tmp_path)]) == [str(tmp_path)]
    with pytest.raises(BadHouse, match="no home file") as error:
        resolve(str(tmp_path))
    assert summary() in str(error.value)
    for word in (".sh3d", ".usdz", ".ifc", "3D-FRONT", "RoomPlan", "ROOT/house/ID of SUNCG"):
        assert word in summary()


def test_a_folder_of_homes_is_refused_where_one_home_is_needed(tmp_path: Path) -> None:
    (tmp_path / "a.glb").write_bytes(b"")
    (tmp_path / "b.sh3d").write_bytes(b"")
    with pytest.raises(BadHouse, match="is a folder of 2 homes"):
        resolve(str(tmp_path))


def test_a_folder_with_homes_one_level_deeper_names_the_right_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("two words/b.glb", "one/a.sh3d", "empty/notes.txt", ".hidden/c.sh3d"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).write_bytes(b"")
    with pytest.raises(BadHouse, match="no home file") as error:
        resolve(str(tmp_path))
    command = shlex.join(["pbrs-farm", "run", str(tmp_path / "one"), str(tmp_path / "two words")])
    expected = f"the homes are one folder deeper, in one and two words: `{command}`"
    assert expected in str(error.value)
    # The folder's error covers it, without an earlier warning.
    assert home_arguments([str(tmp_path)], None) == [str(tmp_path)]
    assert capsys.readouterr().err == ""
    # Next to a home it is a warning, and deeper files are ignored.
    (tmp_path / "top.sh3d").write_bytes(b"")
    assert home_arguments([str(tmp_path)], None) == [str(tmp_path / "top.sh3d")]
    assert expected in capsys.readouterr().err
    # Too many folders for one line are written as the shell's pattern.
    for name in "abc":
        (tmp_path / name).mkdir()
        (tmp_path / name / "home.sh3d").write_bytes(b"")
    home_arguments([str(tmp_path)], None)
    assert f"`pbrs-farm run {tmp_path}/*/`" in capsys.readouterr().err


def test_a_missing_file_is_reported_by_its_format(tmp_path: Path) -> None:
    for name in ("a.usd", "a.glb", "a.sh3d", "a.thing"):
        with pytest.raises(BadHouse, match="no such file"):
            resolve(str(tmp_path / name))


def test_kinds_without_files_have_no_format() -> None:
    assert format_of_source(resolve("builtin")) is None
    assert format_of_kind("nothing") is None
    plan = format_of_kind(PLAN)
    assert plan is not None
    assert plan.has_box_only_items


def test_a_format_without_its_library_stays_listed_with_the_install_command() -> None:
    usd = format_of_kind("usd")
    assert usd is not None
    lacking = replace(usd, library="no_such_module")
    assert "usd" in missing_library(lacking)
    assert missing_library(replace(usd, library="")) == ""


def test_a_plugin_that_brings_no_format_is_the_machines_fault(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    entry = EntryPoint("old", "json:dumps", "pbrs_farm.readers")
    old = Plugin("readers", "old", "package", "1.0", entry)
    monkeypatch.setattr(table, "plugin", lambda _group, _name: old)
    with pytest.raises(MachineFailed, match=r"plugin old of package .* has no Format"):
        format_of_plugin("old")


_LIDAR = '''"""A .lidar file: the width and depth of a room, metres."""

from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.read.common.format import Format, GivenFile


def _read(given: GivenFile, fields: ReadFields) -> House:
    from dataclasses import replace

    from pbrs_farm.read.builtin.builtin_home import builtin_home

    return replace(builtin_home(), name=given.path.read_text())


FORMAT = Format(
    kind="lidar", title="Lidar", files=".lidar", brings="rooms", where="a scanner", licence="yours",
    suffixes=(".lidar",), read=_read,
)
'''


@pytest.fixture
def with_lidar(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A format added as one folder in read/ with one file."""
    from pbrs_farm import read

    (tmp_path / "packages/lidar").mkdir(parents=True)
    (tmp_path / "packages/lidar/__init__.py").write_text(_LIDAR)
    monkeypatch.setattr(read, "__path__", [*read.__path__, str(tmp_path / "packages")])
    table.formats_of_packages.cache_clear()
    yield
    table.formats_of_packages.cache_clear()
    sys.modules.pop("pbrs_farm.read.lidar", None)


@pytest.mark.kinds("format")
@pytest.mark.usefixtures("with_lidar")
def test_a_format_is_added_in_one_file(tmp_path: Path) -> None:
    path = tmp_path / "flat.lidar"
    path.write_text("Scanned")
    source = resolve(str(path))
    house, _report = repaired_house(source, Recipe())
    assert (source.kind, house.name, house.is_repaired) == ("lidar", "Scanned", True)
    assert words_of_homes([str(tmp_path)]) == [str(path)]
    assert ".lidar" in summary()
    # It is uploaded to a farm like any other file.
    ((entry, ref),) = entries_from_arguments([str(path)])
    store = MemoryStore()
    upload(store, [ref])
    assert store.get(SourceRef.model_validate_json(entry.source).location) == b"Scanned"


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-32"])
def test_json_of_other_encodings_is_read_as_utf_8_is(tmp_path: Path, encoding: str) -> None:
    path = WRITERS["react-planner"](tmp_path)
    path.write_bytes(path.read_text("utf-8").encode(encoding))
    assert read_house(resolve(str(path)), ReadFields()).rooms
