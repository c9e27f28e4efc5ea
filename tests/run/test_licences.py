"""The licences of what a view shows: in view.json, in exports, and chosen for the catalogue."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from pbrs_farm.check.cases import ViewCase
from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.fact_checks import check_licences
from pbrs_farm.check.stored_house import StoredHouse
from pbrs_farm.core import keys
from pbrs_farm.core.catalogue import Catalogue, Picture, Piece, Place
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.house import Texture
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.dress.report import Credit, DressReport
from pbrs_farm.export.export_views import export
from pbrs_farm.formats.house_bundle import bundle_from_house
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.prepare.dress_catalogue import catalogue_of
from pbrs_farm.read.builtin.builtin_home import builtin_home
from pbrs_farm.run.attributions import licences_of_view
from pbrs_farm.store.memory_store import MemoryStore
from tests.check.falsehoods import edit_json
from tests.check.roots import make_root


def credit(of: str, licence: str) -> Credit:
    return Credit(id=of, name=of, library="lib", creator="somebody", licence=licence, n=1)


def test_a_view_lists_the_licences_of_its_visible_models_and_pictures(tmp_path: Path) -> None:
    home = builtin_home()
    pictured = next(
        k
        for k, item in enumerate(home.items)
        if any(home.materials[s.material].texture_id for s in item.surfaces)
    )
    texture = next(
        filter(None, (home.materials[s.material].texture_id for s in home.items[pictured].surfaces))
    )
    items = [
        replace(item, tags=(f"dressed:lib#{k}",)) if k < pictured + 2 else item
        for k, item in enumerate(home.items)
    ]
    home = replace(home, items=tuple(items))
    credits = [credit(f"lib#{pictured}", "CC-BY 3.0"), credit(f"lib#{pictured + 1}", "CC0")]
    report = DressReport(
        house_id=home.id, seed=1, credits=(*credits, credit(texture, "CC0"), credit("lib#0", ""))
    )
    store = MemoryStore()
    store.put(keys.house_key(home.id, keys.DRESS), json_bytes(report))
    rows = [{"id": pictured + 1}]
    assert licences_of_view(store, home, rows) == {
        "CC-BY 3.0": [f"lib#{pictured}"],
        "CC0": [texture],
    }
    # An item of the home itself has the home's licence.
    rows.append({"id": len(home.items)})
    assert licences_of_view(store, home, rows)["Apache-2.0"] == ["builtin"]
    assert licences_of_view(MemoryStore(), home, rows[:1]) == {}
    # `verify` finds the same from house.json and dress.json, and every change of it.
    (tmp_path / "house.json").write_bytes(bundle_from_house(home)[1])
    (tmp_path / "dress.json").write_bytes(json_bytes(report))
    listed = licences_of_view(store, home, rows)
    wrong = [listed | {"CC0": []}, {**listed, "CC-BY 4.0": ["lib#9"]}, {"CC0": listed["CC0"]}]
    for licences in (listed, *wrong):
        tally = Tally()
        case = SimpleNamespace(
            house=StoredHouse(tmp_path),
            view=SimpleNamespace(table={"instances": rows, "licences": licences}),
            expect=lambda check, tally=tally: tally.at(check, "a view"),
        )
        check_licences(cast(ViewCase, case))
        assert tally.n_failed == (licences != listed)


def test_a_catalogue_of_chosen_licences() -> None:
    names = ("CC0", "CC-BY 3.0", "CC-BY 4.0", "CC-BY-SA 4.0", "", "CC0")
    pieces = [
        Piece(
            f"p{k}", "", "chair", Place.FLOOR, 5, (1, 1, 1), library="lib" * (k < 5), licence=name
        )
        for k, name in enumerate(names)
    ]
    pictures = tuple(
        Picture(
            Texture(id=name, name=name, media_type="image/png", data=b""),
            "wood",
            (1, 1),
            licence=name,
        )
        for name in ("CC0", "CC-BY 3.0")
    )
    whole = Catalogue(tuple(pieces), lambda _piece: None, "digest", pictures)
    free = whole.with_licences(["CC0"])
    assert [piece.id for piece in free.pieces] == ["p0", "p5"]
    assert [picture.licence for picture in free.pictures] == ["CC0"]
    both = whole.with_licences(["CC0", "CC-BY"])
    assert [piece.id for piece in both.pieces] == ["p0", "p1", "p2", "p5"]
    assert [p.id for p in whole.with_licences(["CC-BY 4.0"]).pieces] == ["p2", "p5"]
    assert whole.with_licences([]) is whole
    with pytest.raises(
        BadInput, match=r"dress\.licences: CCO: no library has it \(did you mean CC0\?"
    ):
        whole.with_licences(["CC-BY", "CCO"])
    assert len({whole.digest, free.digest, both.digest}) == 3


def test_a_recipe_chooses_licences_and_others_keep_their_digest() -> None:
    plain = recipe_from_name("fast")
    assert "licences" not in plain.model_dump()["dress"]
    for text in ('["CC0", "CC-BY"]', "CC0:CC-BY"):
        chosen = recipe_from_name("fast", {"dress.licences": text})
        assert chosen.dress.licences == ("CC0", "CC-BY")
        assert chosen.digest() != plain.digest()
    fields = recipe_from_name("fast", {"dress.licences": "CC0", "dress.catalogue": "generated"})
    assert (
        catalogue_of(fields.dress).digest
        != catalogue_of(recipe_from_name("fast", {"dress.catalogue": "generated"}).dress).digest
    )
    with pytest.raises(BadRecipe, match="licences"):
        recipe_from_name("fast", {"dress.licences": "3"})


def test_an_export_states_the_licences_of_its_views(tmp_path: Path) -> None:
    house = make_root(tmp_path / "root")
    export(tmp_path / "root", tmp_path / "without", "released")
    assert not (tmp_path / "without/licences.txt").exists()
    for k, view in enumerate(sorted((house / "views").iterdir())):
        licences = {("CC0", "CC-BY 3.0")[k]: ["lib#1"]}
        edit_json(view / "view.json", lambda table, new=licences: table.update(licences=new))
    export(tmp_path / "root", tmp_path / "set", "released")
    assert (tmp_path / "set/licences.txt").read_text() == "CC-BY 3.0\nCC0\n"
