"""Irregular and huge files are never read."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.recipe_toml import recipe_from_toml
from pbrs_farm.prepare.source import resolve
from pbrs_farm.regular_files import (
    digest_of_regular,
    fault_of,
    read_regular,
    real_path,
    text_from_bytes,
    text_given,
)


def _device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(20 * 10**9)


@pytest.mark.parametrize("make", [_device, os.mkfifo, Path.mkdir, _sparse])
def test_devices_pipes_folders_and_endless_files_are_refused_immediately(make, tmp_path):
    path = tmp_path / "bad.sh3d"
    make(path)
    for read in (read_regular, digest_of_regular):
        with pytest.raises(OSError, match=r"directory|regular|at most") as caught:
            read(path)
        assert fault_of(caught.value).startswith("cannot be read: ")


def test_a_regular_file_is_read_completely_and_a_longer_one_is_not(tmp_path):
    path = tmp_path / "home"
    path.write_bytes(b"1234")
    assert read_regular(path, 4) == b"1234"
    with pytest.raises(OSError, match="at most"):
        read_regular(path, 3)


@pytest.mark.parametrize("name", ["bad.sh3d", "bad.glb"])
def test_a_link_to_itself_is_a_bad_house_and_no_runtime_error(name, tmp_path):
    path = tmp_path / name
    path.symlink_to(name)
    assert real_path(path) == path
    with pytest.raises(BadHouse):
        resolve(str(path))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_text_of_any_system_is_read_without_its_byte_order_mark(encoding, tmp_path):
    path = tmp_path / "list.txt"
    path.write_bytes("Küche\n".encode(encoding))
    assert text_given(path) == "Küche\n"


def test_damaged_text_is_read_in_part_on_request():
    assert text_from_bytes(b"a\xffb", "replace") == "a\ufffdb"
    with pytest.raises(UnicodeDecodeError):
        text_from_bytes(b"a\xffb")


def test_a_recipe_may_begin_with_a_byte_order_mark(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('recipe = "preview"\n', encoding="utf-8-sig")
    assert recipe_from_toml(path, {}).image == recipe_from_name("preview").image
