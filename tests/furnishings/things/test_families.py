"""Variations of families are closed, have their stated size, and are reproducible."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from pbrs_farm.core.catalogue import EMPTY, Piece, Place
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import ItemKind, Surface
from pbrs_farm.core.mesh import closed_edge_share, face_areas, signed_volume, triangle_corners
from pbrs_farm.core.plugins import plugins
from pbrs_farm.furnishings.things import cloth
from pbrs_farm.furnishings.things.families import (
    drawn_size,
    families,
    families_digest,
    family_numbers,
    family_pieces,
    family_shape,
    with_families,
)
from pbrs_farm.geometry import bodies, outlines

_NAMES = sorted(families())
_MOST_FACES = 3800


def _pieces(name: str) -> list[Piece]:
    return [p for p in family_pieces() if p.id.startswith(f"generated#{name}-")]


def _hold(piece: Piece) -> None:
    shape = family_shape(piece)
    corners = np.concatenate([triangle_corners(s.positions, s.faces) for s in shape.surfaces])
    assert closed_edge_share(np.round(corners, 6)) == 1.0, "closed"
    assert signed_volume(corners, corners.mean((0, 1))) > 0, "faces look outwards"
    assert face_areas(corners).min() > 0, "no face without area"
    assert len(corners) <= _MOST_FACES
    low, high = shape.bounds
    assert np.asarray(piece.size)[[0, 2, 1]] == pytest.approx(high - low, abs=1e-5)
    assert low[1] == pytest.approx(0, abs=1e-6), "stands on its base"
    assert low[0] + high[0] == pytest.approx(0, abs=1e-5)
    back = low[2] if piece.place is Place.WALL else low[2] + high[2]
    assert back == pytest.approx(0, abs=1e-5)
    # It is drawn at about its stated size, so that fitting distorts nothing.
    assert np.asarray(drawn_size(piece)) / piece.size == pytest.approx(1, abs=0.16)
    assert bool(shape.lights) == (piece.kind is ItemKind.LAMP)


@pytest.mark.parametrize("name", _NAMES)
def test_a_variation_is_closed_and_has_its_stated_size(name: str) -> None:
    for piece in _pieces(name)[:2]:
        _hold(piece)


@pytest.mark.slow
@pytest.mark.parametrize("name", _NAMES)
def test_every_variation_is_closed_and_has_its_stated_size(name: str) -> None:
    for piece in _pieces(name):
        _hold(piece)


def test_a_variation_made_again_has_the_same_bits() -> None:
    for name in _NAMES[::4]:
        first, two = (family_shape(_pieces(name)[0]) for _ in range(2))
        assert first.materials == two.materials
        assert [s.positions.tobytes() for s in first.surfaces] == [
            s.positions.tobytes() for s in two.surfaces
        ]


def test_a_catalogue_with_families_has_another_digest_and_loads_them() -> None:
    catalogue = with_families(EMPTY)
    assert catalogue.digest != EMPTY.digest
    piece = catalogue.of("cooker")[0]
    assert catalogue.shape(piece) is not None


@pytest.fixture
def install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[[str, str], None]]:
    """Installs a package of furniture of one file, given its name and text, and removes it again."""
    caches = (plugins, families, family_pieces, family_numbers, families_digest)
    monkeypatch.syspath_prepend(str(tmp_path))

    def installed(name: str, text: str) -> None:
        (tmp_path / f"{name}.py").write_text(text)
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[pbrs_farm.furniture]\n{name} = {name}\n")
        for cached in caches:
            cached.cache_clear()

    yield installed
    for cached in caches:
        cached.cache_clear()


_ONE = """
from pbrs_farm.core.catalogue import Place
from pbrs_farm.geometry.bodies import cylinder
from pbrs_farm.furnishings.things.maker import Maker, Size, family


@family(group="pedestal", place=Place.FLOOR, variants=3, size=lambda m: (0.3, 0.3, m.uniform(0.8, 1)))
def {name}(m: Maker, size: Size) -> None:
    {body}
"""
_BODY = "m.add(cylinder(size[0] / 2, 0, size[2], n=32), of=m.china())"


@pytest.mark.kinds("thing")
def test_a_file_is_all_that_a_new_piece_of_furniture_takes(
    install: Callable[[str, str], None],
) -> None:
    before = with_families(EMPTY)
    assert not before.of("pedestal")
    install("pedestals", _ONE.format(name="pedestal", body=_BODY))
    catalogue = with_families(EMPTY)
    assert catalogue.digest != before.digest
    assert catalogue.pieces[: len(before.pieces)] == before.pieces, "ours stay as they were"
    pieces = catalogue.of("pedestal")
    assert len(pieces) == 3
    for piece in pieces:
        assert catalogue.shape(piece) is not None
        _hold(piece)


@pytest.mark.parametrize(
    ("name", "body", "error"),
    [("sofa", _BODY, "broken: sofa: is already the name of another object"),
     ("nothing", "pass", "broken: nothing: has nothing in it")],
)  # fmt: skip
def test_faults_of_a_plugins_furniture_are_named(
    install: Callable[[str, str], None], name: str, body: str, error: str
) -> None:
    sys.modules.pop("broken", None)
    install("broken", _ONE.format(name=name, body=body))
    with pytest.raises(BadInput, match=error):
        family_shape(family_pieces()[-1])


def test_a_plugin_that_names_no_families_is_refused(install: Callable[[str, str], None]) -> None:
    install("empty_package", "N = 1")
    with pytest.raises(
        BadInput, match=r"empty_package 1\.0: empty_package: is not a module with a"
    ):
        with_families(EMPTY)


def test_kitchen_units_with_one_number_share_a_front() -> None:
    sets: dict[str, list[Piece]] = {}
    for piece in family_pieces():
        if piece.of_set.startswith("kitchen_set") and piece.group in ("base_cabinet", "sink"):
            sets.setdefault(piece.of_set, []).append(piece)
    for pieces in list(sets.values())[:3]:
        fronts = [set(family_shape(p).materials) for p in pieces]
        shared = set.intersection(*fronts)
        assert any("front" in m.name or "wood" in m.name for m in shared)


def test_bodies_have_the_volume_of_their_formulas() -> None:
    def volume(surface: Surface) -> float:
        corners = triangle_corners(surface.positions, surface.faces)
        assert closed_edge_share(np.round(corners, 6)) == 1.0
        return float(signed_volume(corners, corners.mean((0, 1))))

    # A bevel along twelve edges removes half a square of r from each.
    cut = volume(bodies.bevelled((0, 0, 0), (1, 1, 1), 0.02))
    assert cut == pytest.approx(1 - 12 * 0.02**2 / 2, abs=2e-4)
    ball = volume(bodies.rounded((0, 0, 0), (2, 2, 2), 1.0, n=12))
    assert ball == pytest.approx(4 / 3 * np.pi, rel=0.04)
    cone = [(outlines.oval(2, 2, n=64), 0.0), (outlines.oval(1, 1, n=64), 1.0)]
    assert volume(bodies.loft(cone)) == pytest.approx(np.pi / 3 * (1 + 0.5 + 0.25), rel=0.01)
    pipe = bodies.tube([(0, 0, 0), (0, 1, 0), (1, 1, 0)], 0.1, n=32)
    assert volume(pipe) == pytest.approx(2 * np.pi * 0.1**2, rel=0.03)
    ring = bodies.hoop(outlines.oval(2, 2, n=64), 0.5, 0.1, n=32)
    assert volume(ring) == pytest.approx(2 * np.pi**2 * 0.1**2, rel=0.02)
    sheet = cloth.hanging(1.0, 2.0, 0.0, 0.01, 3.0)
    assert volume(sheet) == pytest.approx(1.0 * 2.0 * 0.01, rel=0.05)
