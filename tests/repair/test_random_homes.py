"""Sixty random homes by seed: repair ends, loses no wall, and every text is one safe line."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.core.shown_text import shown
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.prepare.read_source import read_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.repair import repair, summary_of_report
from tests.repair.random_homes import random_home
from tests.repair.shells import unpaired_edges

RECIPE = recipe_from_name("preview")


@pytest.mark.quick(8)
@pytest.mark.parametrize("seed", range(60))
def test_a_strangers_home_is_repaired_without_losing_a_wall(seed: int, tmp_path: Path) -> None:
    name, data = random_home(seed)
    path = tmp_path / name
    path.write_bytes(data)
    house = read_house(resolve(str(path)), RECIPE.read)
    after, report = repair(house, RECIPE.repair)
    assert report.structure.walls_lost == ()
    assert after.is_repaired
    assert len(unpaired_edges(after)) == 0 or name.endswith("glb")
    # Each text is one safe line, and the stored house reads back.
    assert all(note.place == shown(note.place, 120) for note in after.notes)
    assert "\n[   0.1 s] forged" not in summary_of_report(report)
    assert house_from_bundle(*bundle_from_house(after)).id == after.id
