"""The recorded shapes of families belong to the recorded version: neither changes alone.

`python -m tests.furnishings.things.test_made_families` writes the record after VERSION was raised.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from pbrs_farm.core.mesh import face_areas, triangle_corners
from pbrs_farm.furnishings.things.families import VERSION, families, family_pieces, family_shape

_RECORD: Final = Path(__file__).with_name("made_families.csv")
_N_VARIATIONS: Final = 2  # of each family, the first ones
_RAISE: Final = "raise VERSION in pbrs_farm/furnishings/things/families.py, then run this module"


def _made() -> Iterator[tuple[str, int, float, float]]:
    """(family, faces, m2, brightness) of the first variations of each family."""
    for name in families():
        pieces = [p for p in family_pieces() if p.id.startswith(f"generated#{name}-")]
        n_faces, area, brightness = 0, 0.0, 0.0
        for piece in pieces[:_N_VARIATIONS]:
            shape = family_shape(piece)
            for surface in shape.surfaces:
                m2 = float(face_areas(triangle_corners(surface.positions, surface.faces)).sum())
                n_faces, area = n_faces + len(surface.faces), area + m2
                brightness += m2 * float(np.mean(shape.materials[surface.material].diffuse))
        yield name, n_faces, round(area, 4), round(brightness / area, 4)


def _recorded() -> tuple[int, dict[str, tuple[int, float, float]]]:
    with _RECORD.open(newline="") as file:
        (_word, version), *rows = csv.reader(file)
    return int(version), {name: (int(n), float(m2), float(v)) for name, n, m2, v in rows}


def test_the_version_of_families_is_raised_when_they_make_something_else() -> None:
    version, rows = _recorded()
    made = {name: values for name, *values in _made()}
    assert version == VERSION, "run this module: the record is of another version"
    assert list(made) == list(rows), _RAISE
    changed = [name for name in made if made[name] != pytest.approx(rows[name], rel=1e-3, abs=1e-3)]
    assert not changed, _RAISE


if __name__ == "__main__":
    recorded_version, recorded = _recorded() if _RECORD.exists() else (0, {})
    if recorded_version >= VERSION:
        raise SystemExit(_RAISE)
    with _RECORD.open("w", newline="") as record:
        writer = csv.writer(record, lineterminator="\n")
        writer.writerow(("version", VERSION))
        writer.writerows(_made())
