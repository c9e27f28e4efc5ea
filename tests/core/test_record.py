"""Errors in tables beside the code name file and entry."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.record import Record, read_csv, read_toml
from pbrs_farm.dress import furniture, style
from pbrs_farm.dress.furniture import FurnitureTable
from pbrs_farm.dress.style import StyleTable
from pbrs_farm.generate.furnish import briefs
from pbrs_farm.generate.furnish.briefs import BriefTable
from pbrs_farm.read.builtin import builtin_home
from pbrs_farm.read.builtin.builtin_home import BuiltinTable


class _Row(Record):
    name: str
    share: float = 0.0


def test_rows_of_a_csv_are_read_and_lines_with_a_hash_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("# shares\nname,share\noak,0.5\nash,1\n")
    rows = read_csv(tmp_path / "a.csv", _Row)
    assert [(r.name, r.share) for r in rows] == [("oak", 0.5), ("ash", 1.0)]


def test_a_bad_row_of_a_csv_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("name,share\noak,0.5\nash,much\n")
    with pytest.raises(BadInput, match=r"a\.csv: ash share: .*number"):
        read_csv(tmp_path / "a.csv", _Row)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('light = "c9a679"', 'light = "c9a6"', "woods oak light: .*six hexadecimal digits"),
        ("figure = 0.75", "figures = 0.75", "woods ash figures: no such field"),
        ('"pale oak", "birch"', '"pale oak", "brich"', "nordic: no wood or metal brich"),
        ("woods = [", "woods = ", "Invalid|invalid|Expected|Unclosed"),
    ],
)
def test_faults_in_the_styles_are_named(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = Path(style.__file__).with_name("style.toml").read_text("utf-8")
    assert old in text
    (tmp_path / "style.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(BadInput, match=rf"style\.toml: (?:.*)(?:{message})"):
        read_toml(tmp_path / "style.toml", StyleTable)


@pytest.mark.parametrize(
    ("module", "name", "kind", "old", "new", "message"),
    [
        (furniture, "furniture", FurnitureTable, '"low bookcase", 0.4', '"high", 0.4', "living: no kind high"),
        (furniture, "furniture", FurnitureTable, '"night stand"', '"nite"', "kinds nightstand alike 0: .*NYU40"),
        (briefs, "briefs", dict[str, BriefTable], "double_beds", "waterbeds", "bedroom groups bed of 0 make: .*waterbeds"),
        (builtin_home, "builtin", BuiltinTable, '["rug", "0_0"', '["mat", "0_0"', "places: no piece mat"),
        (builtin_home, "builtin", BuiltinTable, 'material = "clay"', 'material = "mud"', "plant: no material mud"),
    ],
)  # fmt: skip
def test_faults_in_a_table_are_named(
    tmp_path: Path, module: ModuleType, name: str, kind: type, old: str, new: str, message: str
) -> None:
    text = Path(str(module.__file__)).with_name(f"{name}.toml").read_text("utf-8")
    assert old in text
    (tmp_path / "table.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(BadInput, match=rf"table\.toml: .*{message}"):
        read_toml(tmp_path / "table.toml", kind)
