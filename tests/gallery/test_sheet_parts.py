"""Parts of a sheet prepared view by view equal those of the sheet."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import pytest

from pbrs_farm.commands.using import write_sheets
from pbrs_farm.gallery.sheet_parts import SheetParts
from tests.inputs.sheet_house import write_house


@pytest.fixture
def root(tmp_path: Path) -> Path:
    write_house(tmp_path, "a", ("0_0_1", "0_0_2", "0_1_0"))
    return tmp_path


def sheets(root: Path) -> tuple[bytes, bytes]:
    return (root / "sheet.png").read_bytes(), (root / "index.html").read_bytes()


def test_sheets_of_parts_made_ahead_are_the_same(root: Path) -> None:
    write_sheets(root, 24)
    at_once = sheets(root)
    with closing(SheetParts(root)) as parts:
        parts.make("a", "0_0_2")
        parts.make("a", "0_1_0")
        write_sheets(root, 24, parts)
    assert sheets(root) == at_once


def test_parts_made_ahead_are_not_made_again(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with closing(SheetParts(root)) as parts:
        for view in ("0_0_1", "0_0_2", "0_1_0"):
            parts.make("a", view)
        assert len(parts.tiles()) == len(parts.cards()) == 3
        monkeypatch.setattr("pbrs_farm.images.array_from_png", lambda *_: pytest.fail("read"))
        write_sheets(root, 24, parts)


def test_a_view_that_is_not_there_is_left_to_the_sheet(root: Path) -> None:
    with closing(SheetParts(root)) as parts:
        parts.make("a", "9_9_9")
        parts.make("a", "0_0_1")
        write_sheets(root, 24, parts)
    assert b"0_0_1" in (root / "index.html").read_bytes()
