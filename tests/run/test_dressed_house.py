"""Dressed variants of a home: ids, digests, stored files, refused input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pbrs_farm.cli import main
from pbrs_farm.commands.arguments import dress_seeds
from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.recipe import picture_groups, recipe_from_name
from pbrs_farm.dress.report import Credit, DressReport, Gate, summary_of_dressing
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.run.attributions import attribution_text, write_attribution
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore

GENERATED = {"dress.catalogue": "generated"}
FEW = {"dress.clutter": "0", "dress.textiles": "0", "dress.swap": "0", "surroundings.kind": "none"}


def credit(name: str, licence: str, n: int = 1) -> Credit:
    return Credit(
        id=f"lib#{name}", name=name, library="Lib", creator="Someone", licence=licence, n=n
    )


@pytest.mark.parametrize(
    ("text", "seeds"),
    [("3", (3,)), ("1..4", (1, 2, 3, 4)), ("5,2,5", (5, 2)), ("1..2,9", (1, 2, 9)), (None, ())],
)
def test_seeds_are_read_in_their_written_form(text, seeds):
    assert dress_seeds(text) == seeds


@pytest.mark.parametrize("text", ["", "x", "1..", "0", "-1", "4..2", "1.5", "1..999999", "٣"])
def test_a_seed_that_is_no_number_is_refused_in_one_line(text):
    with pytest.raises(BadInput, match="--dress"):
        dress_seeds(text)


def test_a_variant_is_a_separate_house_and_names_its_home():
    source = resolve("builtin")
    bare, first, third = variants(source, [0, 1, 3])
    assert bare == source
    assert first.house_id == f"{source.house_id}-d1"
    assert third.dress_seed == 3
    assert third.fingerprint == source.fingerprint


def test_an_object_without_context_is_never_dressed():
    source = resolve("builtin").model_copy(update={"kind": "object"})
    assert variants(source, [1, 2]) == [source]


def test_fields_of_dressing_are_in_the_digest_of_a_recipe():
    recipe = recipe_from_name("paper")
    assert "dress" in picture_groups()
    dressed = recipe_from_name("paper", {"dress.seed": "3"})
    assert dressed.digest() != recipe.digest()


@pytest.mark.parametrize("value", ["1.5", "-1", "nan", "x"])
def test_a_share_outside_0_to_1_is_refused(value):
    with pytest.raises(BadRecipe):
        recipe_from_name("fast", {"dress.clutter": value})


@pytest.mark.long
def test_the_house_step_writes_the_reports_of_dressing_and_repair():
    store = MemoryStore()
    recipe = recipe_from_name("preview", GENERATED | FEW)
    (source,) = variants(resolve("builtin"), [2])
    work = Work(store, recipe, source.house_id, HouseCache(), source=source)
    run_step("house", work)
    report = DressReport.model_validate_json(store.get(keys.house_key(source.house_id, keys.DRESS)))
    assert (report.house_id, report.seed) == (source.house_id, 2)
    house = json.loads(store.get(keys.house_key(source.house_id, "house.json")))
    assert house["id"] == source.house_id
    # Another value of any share is another house.
    again = recipe_from_name("preview", GENERATED | FEW | {"dress.walls": "0.5"})
    assert run_step("house", work).was_done
    assert not run_step("house", Work(store, again, work.house_id, HouseCache(), source)).was_done


def test_a_bare_house_has_no_report_of_dressing():
    store, source = MemoryStore(), resolve("builtin")
    work = Work(store, recipe_from_name("preview"), source.house_id, HouseCache(), source=source)
    run_step("house", work)
    assert store.head(keys.house_key(source.house_id, keys.DRESS)) is None


def test_free_pictures_need_no_attribution_and_others_are_named_once():
    assert attribution_text(["home by A"], [credit("chair", "CC0")]) == ""
    text = attribution_text(
        ["home by A", "home by A"],
        [credit("chair", "CC0"), credit("bed", "CC-BY 3.0"), credit("bed", "CC-BY 3.0", 4)],
    )
    assert text.count("bed, by Someone (Lib): CC-BY 3.0") == 1
    assert text.count("home by A") == 1
    assert "chair" in text


def _dressed(store: MemoryStore, house: str, *names: str) -> None:
    """Put a dressed house's report and its manifest row into a root."""
    report = DressReport(
        house_id=house, seed=1, credits=tuple(credit(n, "CC-BY 3.0") for n in names)
    )
    store.put(keys.house_key(house, keys.DRESS), json_bytes(report))
    rows = store.get(keys.MANIFEST) if store.head(keys.MANIFEST) else b""
    row = {"key": keys.house_key(house, keys.DRESS), "sha256": house, "attribution": "home by A"}
    store.put(keys.MANIFEST, rows + keys.canonical_json(row).encode() + b"\n")


def test_the_root_names_the_models_of_all_its_houses():
    store = MemoryStore()
    write_attribution(store)
    assert store.head(keys.ATTRIBUTION) is None
    _dressed(store, "a-d1", "bed")
    _dressed(store, "b-d1", "sofa")
    write_attribution(store)
    text = store.get(keys.ATTRIBUTION).decode()
    assert "bed" in text
    assert "sofa" in text


def test_a_house_that_comes_in_while_the_attribution_is_written_is_not_forgotten():
    class Store(MemoryStore):
        def put(self, key, data):
            super().put(key, data)
            if key == keys.ATTRIBUTION and not self.head(keys.house_key("late-d1", keys.DRESS)):
                _dressed(self, "late-d1", "lamp")

    store = Store()
    _dressed(store, "a-d1", "bed")
    write_attribution(store)
    assert "lamp" in store.get(keys.ATTRIBUTION).decode()


def test_the_report_lists_additions_and_broken_gates_in_plain_words():
    report = DressReport(
        house_id="home-d1", seed=1, style="nordic", added={"walls: picture": 3, "clutter: cup": 5},
        refused={"clutter: no room": 2}, changed={"parts": 4},
        gates=(
            Gate(name="support", n_checked=9, n_taken_out=1, n_left=0),
            Gate(name="doors", n_checked=2, n_taken_out=0, n_left=1),
        ),
    )  # fmt: skip
    text = summary_of_dressing(report)
    assert "walls: 3 added: 3 picture." in text
    assert "clutter: not done: 2 no room." in text
    assert "GATE BROKEN: every door opens" in text
    assert not report.is_sound


@pytest.mark.long
def test_the_verb_writes_the_bundle_the_report_and_a_picture(tmp_path: Path, capsys):
    words = ["dress", "builtin", "--seed", "2", "--out", str(tmp_path), "--catalogue", "generated",
             "--recipe", "preview", "--size", "96x72", "--set", "light.spp=1",
             "--set", "light.pilot_spp=0", "--set", "cameras.cell_m=1"]  # fmt: skip
    words += [word for field, value in FEW.items() for word in ("--set", f"{field}={value}")]
    assert main(words) == 0
    for name in ("before_after.png", "house.glb", "house.json", "dress.json", "repair.json"):
        assert (tmp_path / name).stat().st_size > 100, name
    assert "dressed by seed 2" in capsys.readouterr().out


def test_an_unknown_style_is_refused_with_the_known_ones(tmp_path: Path, capsys):
    words = ["dress", "builtin", "--out", str(tmp_path), "--catalogue", "generated"]
    assert main([*words, "--set", "dress.style=baroque"]) == 1
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "nordic" in message


def test_an_unknown_catalogue_is_refused_in_one_line(tmp_path: Path, capsys):
    words = ["dress", "builtin", "--out", str(tmp_path / "out")]
    assert main([*words, "--catalogue", f"generated:{tmp_path}/none.sh3f"]) == 1
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("seed", ["x", "0", "1..3"])
def test_the_verb_refuses_an_invalid_seed_in_one_line(seed, tmp_path: Path, capsys):
    assert main(["dress", "builtin", "--seed", seed, "--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.count("\n") == 1
