"""verify looks through the holes of surfaces by its own rays."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrs_farm.core.house import geometry_from_house
from pbrs_farm.raycast.caster import Caster
from tests.check.perforated_homes import MATERIALS, screened
from tests.check.roots import failed, make_root


@pytest.mark.quick(1)
@pytest.mark.parametrize("name", MATERIALS)
def test_every_layer_of_a_home_with_holes_agrees_with_independent_rays(
    tmp_path: Path, name: str
) -> None:
    home = screened(MATERIALS[name])
    make_root(tmp_path, home, with_optional=True)
    assert failed(tmp_path) == set()


@pytest.mark.quick(1)
@pytest.mark.parametrize("wrong", ["solid", "other cutoff"])
def test_labels_of_a_solid_surface_or_of_another_cutoff_are_caught(
    tmp_path: Path, wrong: str
) -> None:
    home = screened(MATERIALS["leaf"])
    replacement = screened(MATERIALS["whole" if wrong == "solid" else "low"])
    caster = Caster.of_house(replacement, geometry_from_house(home))
    make_root(tmp_path, home, caster=caster)
    assert {"ray: instance", "ray: depth"} <= failed(tmp_path)
