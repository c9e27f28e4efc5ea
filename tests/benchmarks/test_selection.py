"""The packs that the bench of selection writes are packs that selection reads."""

from __future__ import annotations

from pathlib import Path

from benchmarks.selection import VIEWS_PER_HOUSE, write_packs
from pbrs_farm.selection.histogram_pack import pack_from_bytes


def test_synthetic_packs_are_read_back(tmp_path: Path) -> None:
    n_bytes = write_packs(tmp_path, VIEWS_PER_HOUSE + 1)
    files = sorted(tmp_path.iterdir())
    assert len(files) == 2
    assert n_bytes == sum(file.stat().st_size for file in files)
    packs = [pack_from_bytes(file.read_bytes(), file.name) for file in files]
    assert [int(pack.house, 16) for pack in packs] == [0, 1]
    for pack in packs:
        assert len(pack.views) == len(pack.black) == len(pack.colour) == VIEWS_PER_HOUSE
