"""pf.generate_model generates furniture with given parameters."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbrs_farm as pf
from pbrs_farm.core.classes import BED
from pbrs_farm.core.house import Material
from pbrs_farm.core.mesh import closed_edge_share
from pbrs_farm.dress.style import style_for
from pbrs_farm.furnishings.things.families import families
from pbrs_farm.furnishings.things.maker import Maker
from pbrs_farm.furnishings.things.parameters import Choice, parameters_of

_WITH_PARAMETERS = {name: f for name, f in families().items() if f.draw is not None}


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PBRS_CACHE", str(tmp_path))


def test_a_bed_has_the_width_and_the_slats_that_are_asked_for() -> None:
    bed = pf.generate_model("bed", width_m=1.6, slats=True, mattress=False, seed=3)
    board = pf.generate_model("bed", width_m=1.6, mattress=False, seed=3)
    assert bed.size_m[0] == pytest.approx(1.6, abs=1e-5)
    assert len(bed.shape.triangles) > len(board.shape.triangles)
    assert bed.ref.nyu40 == BED


def test_the_seed_decides_what_is_not_given() -> None:
    one, same, other = (pf.generate_model("sofa", seed=seed) for seed in (1, 1, 2))
    assert one.ref == same.ref
    assert one.ref.sha256 != other.ref.sha256


def test_a_colour_stands_for_a_material() -> None:
    bed = pf.generate_model("bed", head="panel", frame="#ff0000")
    assert any(
        m.diffuse == pytest.approx((0.95, 0.02, 0.02), abs=0.01) for m in bed.shape.materials
    )


def test_a_thing_stands_in_a_home() -> None:
    cup = pf.generate_model("cup", seed=4)
    home = pf.load("builtin").place(cup, on="dining table", seed=1)
    assert home.items["cup 1"].name == "cup"


@pytest.mark.parametrize(
    ("call", "error"),
    [
        ({"name": "bedd"}, "bedd: no such object to generate .did you mean bed"),
        ({"name": "bed", "slat": True}, "bed: has no parameter 'slat' .did you mean slats"),
        ({"name": "bed", "width_m": 9}, r"bed, width_m: 9 does not fit, expected a number in 0\."),
        ({"name": "bed", "slats": 2}, "bed, slats: 2 does not fit, expected True or False"),
        ({"name": "bed", "sleepers": 1.5}, "bed, sleepers: 1.5 does not fit, expected a whole"),
        ({"name": "bed", "head": "slat"}, "bed, head: 'slat' is not a choice .did you mean slats"),
        ({"name": "bed", "frame": "#12"}, "bed, frame: '#12' does not fit, expected \"#rrggbb\""),
        ({"name": "cup", "width_m": 1}, "cup: has no parameter 'width_m'"),
        ({"name": "toilet", "lid": 1}, "toilet: has no parameter 'lid'"),
    ],
)
def test_impossible_parameters_are_one_clear_error(call: dict[str, Any], error: str) -> None:
    with pytest.raises(pf.BadInput, match=error):
        pf.generate_model(**call)


@pytest.mark.quick(4)
@pytest.mark.parametrize("name", sorted(_WITH_PARAMETERS))
def test_every_choice_of_a_family_makes_a_closed_piece(name: str) -> None:
    family = _WITH_PARAMETERS[name]
    style = style_for(np.random.default_rng(1))
    shared = family.shared(np.random.default_rng(2), style)
    size = family.size(np.random.default_rng(3), style, *shared)
    assert family.draw is not None
    drawn = family.draw(Maker(np.random.default_rng(4), style), size, *shared)
    for field, hint in parameters_of(type(drawn)).items():
        is_many, inner = hasattr(hint, "__args__") and hint.__origin__ is tuple, hint
        if is_many:
            inner = hint.__args__[0]
        choice = getattr(inner, "__metadata__", (None,))[0]
        values = (
            choice.words if isinstance(choice, Choice) else (True, False) if hint is bool else ()
        )
        for value in values:
            model = pf.generate_model(name, seed=4, **{field: value})
            assert closed_edge_share(np.round(model.shape.triangles, 5)) > 0.999, (field, value)


def test_parameters_have_types_that_are_checked() -> None:
    for name, family in _WITH_PARAMETERS.items():
        style = style_for(np.random.default_rng(1))
        shared = family.shared(np.random.default_rng(2), style)
        size = family.size(np.random.default_rng(3), style, *shared)
        assert family.draw is not None
        drawn = family.draw(Maker(np.random.default_rng(4), style), size, *shared)
        for field in fields(drawn):
            hint = parameters_of(type(drawn))[field.name]
            inner = hint.__args__[0] if getattr(hint, "__origin__", None) is tuple else hint
            assert inner in (bool, Material) or hasattr(inner, "__metadata__"), (name, field.name)


def test_the_docs_list_every_parameter() -> None:
    page = (Path(__file__).parents[2] / "docs/dress/catalogue.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    for name, family in _WITH_PARAMETERS.items():
        style = style_for(np.random.default_rng(1))
        shared = family.shared(np.random.default_rng(2), style)
        size = family.size(np.random.default_rng(3), style, *shared)
        assert family.draw is not None
        drawn = family.draw(Maker(np.random.default_rng(4), style), size, *shared)
        row = next(
            r
            for r in rows
            if {f"`{name}`", f"`{family.called}`"} & {*r.split("|")[1].replace(",", " ").split()}
        )
        assert row.split("|")[2].replace("`", "").replace(",", " ").split() == [
            *parameters_of(type(drawn))
        ]
