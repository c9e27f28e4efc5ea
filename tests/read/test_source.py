"""From a word to a source; a source that changed since it was named is reported, for every format."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve, suncg_list
from tests.example_homes import example_homes


def test_a_suncg_house_changed_since_submission_is_reported(tmp_path: Path) -> None:
    house = tmp_path / "house/0a1b/house.json"
    house.parent.mkdir(parents=True)
    house.write_text("{}")
    source = resolve(str(house.parent))
    house.write_text('{"levels": []}')
    with pytest.raises(BadHouse, match="changed since the run began"):
        read_house(source, ReadFields())


def test_a_file_changed_since_submission_is_reported(tmp_path: Path) -> None:
    home = tmp_path / "home.sh3d"
    home.write_bytes(b"PK")
    source = resolve(str(home))
    home.write_bytes(b"PK2")
    with pytest.raises(BadHouse, match="changed since the run began"):
        read_house(source, ReadFields())


@pytest.mark.homes
def test_another_version_of_the_example_homes_is_the_machines_fault() -> None:
    from pbrs_farm.core.errors import MachineFailed

    example_homes()
    source = resolve("Studio").model_copy(update={"sha256": "0" * 64})
    with pytest.raises(MachineFailed, match="Studio differs"):
        read_house(source, ReadFields())


@pytest.mark.parametrize("name", ["chair.fbx", "house.blend", "house.SKP", "room.dae"])
def test_a_file_of_another_program_is_refused_with_the_readable_formats(
    tmp_path: Path, name: str
) -> None:
    path = tmp_path / name
    path.write_bytes(b"bytes")
    with pytest.raises(BadHouse, match="files are not read"):
        resolve(str(path))


def test_a_list_of_houses_names_the_line_that_is_no_id(tmp_path: Path) -> None:
    path = tmp_path / "list.txt"
    path.write_text("# all\n0004d5\n" + "a" * 100_000)
    with pytest.raises(BadHouse, match="line 3: an id of 100000 letters"):
        suncg_list(tmp_path, path)


def test_a_folder_of_models_names_the_verb_objects(tmp_path: Path) -> None:
    (tmp_path / "chair.obj").write_bytes(b"")
    with pytest.raises(BadHouse, match="pbrs-farm objects"):
        resolve(str(tmp_path))
