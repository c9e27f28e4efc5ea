"""Every generated item and family has the shape that recorded_things.csv records for two seeds.

`python -m tests.furnishings.things.test_recorded_things` writes the file again, after an intended change. If
families change, raise FAMILIES_VERSION first: the digest of dressed homes contains it, not the code.
"""

from __future__ import annotations

import csv
import hashlib
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.catalogue import FAMILIES_VERSION
from pbrs_farm.dress.models import Model
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.thing_materials import plain
from pbrs_farm.furnishings.things.case_goods import CASE_GOODS, Boards
from pbrs_farm.furnishings.things.families import families
from pbrs_farm.furnishings.things.things import THINGS

_FILE = Path(__file__).with_name("recorded_things.csv")
_NAMES = [
    *(f"thing {name}" for name in THINGS),
    *(f"case {name}" for name in CASE_GOODS),
    *(f"family {name}" for name in families()),
]


def _model(name: str, seed: int) -> Model:
    kind, _, key = name.partition(" ")
    rng, style = np.random.default_rng(seed), style_for(np.random.default_rng(seed + 100))
    if kind == "thing":
        return THINGS[key].make(rng, style)
    if kind == "case":
        body, front, top = (plain(n, (0.5, 0.5, 0.5), 0.5) for n in ("body", "front", "top"))
        return CASE_GOODS[key].make(rng, style, Boards(body, front, top), (1.0, 1.2, 0.4))
    family = families()[key]
    shared = family.shared(np.random.default_rng(seed + 7), style)
    size = family.size(np.random.default_rng(seed + 9), style, *shared)
    return family.make(rng, style, size, *shared)


def _digest(model: Model) -> str:
    piece, shape = model
    text = hashlib.sha256(repr((piece.id, piece.group, piece.place.name, piece.nyu40)).encode())
    text.update(repr([(m.name, m.kind.name) for m in shape.materials]).encode())
    text.update(repr([(j.part, j.kind.name, j.axis) for j in shape.joints]).encode())
    for surface in shape.surfaces:
        text.update(repr((surface.material, surface.part, len(surface.faces))).encode())
        # Steps of which no dimension is a multiple: processors round the last bit differently.
        steps = np.floor(surface.positions.astype(np.float64) / (1e-4 * np.pi) + 0.37)
        text.update(steps.astype(np.int32).tobytes())
    return text.hexdigest()[:12]


def _recorded() -> dict[str, list[str]]:
    with _FILE.open(newline="") as file:
        return {name: digests for name, *digests in csv.reader(file)}


def test_every_thing_and_family_is_recorded_with_the_version_of_families() -> None:
    assert sorted(_recorded()) == sorted([*_NAMES, "version"])
    assert _recorded()["version"] == [str(FAMILIES_VERSION)]


@pytest.mark.parametrize("name", _NAMES)
def test_an_item_has_its_recorded_shape(name: str) -> None:
    assert [_digest(_model(name, seed)) for seed in range(2)] == _recorded()[name]


if __name__ == "__main__":
    made = {name: [_digest(_model(name, seed)) for seed in range(2)] for name in _NAMES}
    before = _recorded()
    changed = [n for n, row in made.items() if n.startswith("family ") and before.get(n) != row]
    if changed and before.get("version") == [str(FAMILIES_VERSION)]:
        raise SystemExit(f"raise FAMILIES_VERSION of core/catalogue.py: {', '.join(changed)}")
    with _FILE.open("w", newline="") as file:
        rows = {"version": [FAMILIES_VERSION], **made}
        csv.writer(file, lineterminator="\n").writerows([name, *row] for name, row in rows.items())
