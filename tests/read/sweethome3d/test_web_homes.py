"""Homes of Sweet Home 3D JS, which names the program's models by their addresses."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.sweethome3d.home import read_home
from tests.read.sweethome3d.sh3d_source import BOX_OBJ, WALLS, home_xml, piece, sh3d


class Jar:
    def read(self, name: str) -> bytes | None:
        return BOX_OBJ if name == "com/eteks/sweethome3d/io/resources/arm chair.obj" else None


@pytest.mark.parametrize(
    "model",
    [
        "lib/resources/models/chair.zip!/arm%20chair.obj",
        "jar:https://example.org/models/chair.zip!/arm%20chair.obj",
        "https://example.org/lib/resources/arm chair.obj",
    ],
)
def test_models_of_the_program_are_found_by_their_addresses(model: str) -> None:
    data = sh3d(home_xml(WALLS + piece(f"model='{model}' name='Chair'")))
    house = read_home(data, "home.sh3x", resources=Jar(), fields=ReadFields())
    assert [i.name for i in house.items if i.nyu40 == 5] == ["Chair"]
    assert not [n for n in house.notes if n.kind == "missing-model"]


def test_a_sh3x_is_a_home(tmp_path: Path) -> None:
    path = tmp_path / "home.sh3x"
    path.write_bytes(sh3d(home_xml(WALLS)))
    assert resolve(str(path)).kind == "sweethome3d"
