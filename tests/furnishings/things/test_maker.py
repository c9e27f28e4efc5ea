"""Solids added to a maker get the material and transform of their context."""

from __future__ import annotations

import numpy as np
import pytest

from pbrs_farm.core.catalogue import Place
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import rotation_y
from pbrs_farm.core.house import Surface
from pbrs_farm.dress.style import style_for
from pbrs_farm.dress.thing_materials import BRASS, STEEL, WHITE
from pbrs_farm.furnishings.things.maker import Maker, thing
from pbrs_farm.furnishings.things.shapes import on_side, row
from pbrs_farm.geometry.bodies import slab
from pbrs_farm.geometry.outlines import Triple

_STYLE = style_for(np.random.default_rng(1))


def _maker(seed: int = 1) -> Maker:
    return Maker(np.random.default_rng(seed), _STYLE)


def _cube(x: float = 0.0) -> Surface:
    return slab((x, 0.0, 0.0), (x + 1.0, 1.0, 1.0))


def _low(solid: Surface) -> Triple:
    x, y, z = (float(v) for v in solid.positions.min(0))
    return (x, y, z)


def test_the_nearest_material_applies_unless_a_solid_names_another() -> None:
    m = _maker()
    with m.of(STEEL):
        m.add(_cube())
        with m.of(WHITE):
            m.add(_cube())
        m.add(_cube(), of=BRASS)
    assert [material for _solid, material in m.finished("file", "name")] == [STEEL, WHITE, BRASS]


def test_solids_moved_together_are_turned_and_then_shifted() -> None:
    m = _maker()
    quarter = rotation_y(np.pi / 2)
    with m.of(STEEL), m.moved(at=(0.0, 2.0, 0.0)):
        m.add(_cube(), turn=quarter, at=(5.0, 0.0, 0.0))
        with m.moved(turn=quarter):
            m.add(_cube(), at=(5.0, 0.0, 0.0))
    first, second = (_low(solid) for solid, _material in m.finished("file", "name"))
    # A quarter turn takes +x to -z and +z to +x.
    assert first == pytest.approx((5.0, 2.0, -1.0))
    assert second == pytest.approx((0.0, 2.0, -6.0))


def test_an_item_has_the_parameters_of_its_function() -> None:
    @thing(group="box", place=Place.FLOOR)
    def block(m: Maker, edge: float) -> None:
        m.name = "small_block" if edge < 0.5 else ""
        m.add(slab((0.0, 0.0, 0.0), (edge, edge, edge)), of=STEEL, name="side")

    piece, shape = block.make(np.random.default_rng(1), _STYLE, 0.25)
    assert (piece.name, piece.group, piece.place) == ("Small block", "box", Place.FLOOR)
    assert piece.size == pytest.approx((0.25, 0.25, 0.25))
    assert [surface.name for surface in shape.surfaces] == ["side"]
    assert block.make(np.random.default_rng(1), _STYLE, 1.0)[0].name == "Block"


def test_a_solid_without_a_material_is_an_error_that_names_the_item() -> None:
    @thing(group="box")
    def bare(m: Maker) -> None:
        m.add(_cube())

    with pytest.raises(BadInput, match="bare: has nothing in it, or a part without a material"):
        bare.make(np.random.default_rng(1), _STYLE)


def test_a_share_of_chances_holds_and_a_choice_named_twice_is_twice_as_likely() -> None:
    m, n = _maker(), 4000
    # Five standard deviations of a binomial share.
    margin = 5 * (0.25 / n) ** 0.5
    assert sum(m.chance(0.3) for _ in range(n)) / n == pytest.approx(0.3, abs=margin)
    picked = [m.pick("wood", "wood", "metal") for _ in range(n)]
    assert picked.count("wood") / n == pytest.approx(2 / 3, abs=margin)


def _bounds_of(m: Maker) -> list[list[float]]:
    return [
        [round(float(v), 4) for v in (*s.positions.min(0), *s.positions.max(0))]
        for s, _ in m.finished("file", "name")
    ]


def test_a_box_is_given_by_sizes_starts_middles_or_ends() -> None:
    m = _maker()
    with m.of(STEEL):
        m.box(0.4, 0.2, 0.6)
        m.box(0.1, 0.2, 0.3, 0.01, left=-0.5, on=1.0, against=-0.3)
        m.box((0.1, 0.3), (0.5, 0.6), 0.2, z=0.4)
    assert _bounds_of(m) == [
        [-0.2, 0.0, -0.3, 0.2, 0.2, 0.3],
        [-0.5, 1.0, -0.3, -0.4, 1.2, 0.0],
        [0.1, 0.5, 0.3, 0.3, 0.6, 0.5],
    ]


def test_a_mirrored_solid_is_repeated_on_the_other_side() -> None:
    m = _maker()
    with m.of(STEEL):
        m.box(0.1, 1.0, 0.1, left=-0.5, against=-0.4, mirrored="xz")
        m.cylinder(0.1, 0.0, 0.2, n=4, at=(-0.5, 0.0, 0.2), mirrored="x")
    lows = [(row[0], row[2]) for row in _bounds_of(m)]
    assert lows == [(-0.5, -0.4), (-0.5, 0.3), (0.4, -0.4), (0.4, 0.3), (-0.6, 0.1), (0.4, 0.1)]


def test_a_rod_runs_along_the_axis_of_its_pair() -> None:
    m = _maker()
    m.rod((-0.5, 0.5), 0.2, 0.1, 0.05, of=STEEL)
    ((x0, y0, _z0, x1, y1, _z1),) = _bounds_of(m)
    assert (x0, x1) == (-0.5, 0.5)
    assert (y0 + y1) / 2 == pytest.approx(0.2, abs=1e-6)


def test_a_row_divides_a_length_into_equal_parts_with_gaps() -> None:
    parts = [pytest.approx(part) for part in row(-0.3, 0.3, 3, gap=0.02)]
    assert parts == [(-0.29, -0.11), (-0.09, 0.09), (0.11, 0.29)]
    assert on_side(-1.0, 0.2, 0.5) == (-0.5, -0.2)
