"""The plan: which steps, which digests, which views."""

from __future__ import annotations

import pytest

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput, BadRecipe
from pbrs_farm.core.lighting import Mode
from pbrs_farm.core.recipe import differences, recipe_from_name
from pbrs_farm.formats.marker import Marker
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.request import Wanted
from pbrs_farm.run.step_cache import StepOutput, Work, run_unless_done
from pbrs_farm.store import MemoryStore


def digest_of(step: str, **overrides: str) -> str:
    fields = {k.replace("__", "."): v for k, v in overrides.items()}
    return plan.step_digest(plan.STEPS[step], recipe_from_name("fast", fields), "h", "v", {})


def test_a_step_reads_only_steps_that_exist() -> None:
    for step in plan.STEPS.values():
        assert {*step.after, *step.needs} <= set(plan.STEPS)


def test_changes_of_illuminance_change_light_too() -> None:
    illuminance, light = plan.STEPS["illuminance"], plan.STEPS["light"]
    assert set(illuminance.groups) <= set(light.groups)
    assert set(illuminance.after) <= set(light.after)


def test_illuminance_is_measured_once_a_house_before_its_views_and_never_of_an_object() -> None:
    want = plan.wanted(["mlt_ol"], [])
    assert plan.house_steps(want, "home-1") == ("house", "cameras", "illuminance")
    assert plan.house_steps(plan.wanted(["opengl_dl"], []), "home-1") == ("house", "cameras")
    assert plan.house_steps(want, "object_chair") == ("house", "cameras")


def test_changing_the_tone_runs_develop_again_and_nothing_before_it() -> None:
    changed = {s for s in plan.STEPS if digest_of(s) != digest_of(s, tone__key="0.3")}
    assert changed == {"develop"}


def test_an_input_that_changed_changes_the_digest() -> None:
    recipe = recipe_from_name("fast")
    step = plan.STEPS["truth"]
    assert plan.step_digest(step, recipe, "h", "v", {"house": "a"}) != plan.step_digest(
        step, recipe, "h", "v", {"house": "b"}
    )


def test_the_name_of_a_recipe_is_no_part_of_its_digest() -> None:
    by_name = recipe_from_name("preview")
    by_fields = recipe_from_name(
        "fast", {"image.width_px": "320", "image.height_px": "240", "light.spp": "10"}
    )
    assert by_name.digest() == by_fields.digest()
    assert differences(by_name, by_fields) == []


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("paper", "efc67b2ca357668471c49fc33bf3afae"),
        ("released", "65c491c91e7dc4741665bf4fc5737803"),
    ],
)
def test_features_missing_in_the_paper_are_off_in_paper_and_released(
    name: str, digest: str
) -> None:
    assert recipe_from_name(name).digest() == digest
    assert not recipe_from_name(name).repair.lamp_in_every_room
    assert recipe_from_name(name).repair.lamp_lx == 0
    assert recipe_from_name(name).dress.open_share == 0
    assert recipe_from_name(name).dress.float_share == 0
    assert not recipe_from_name(name).repair.add_ceilings
    assert recipe_from_name(name).surroundings.kind == "none"
    assert recipe_from_name(name).selection.min_room_lx == 0
    for recipe_name in ("preview", "fast"):
        recipe = recipe_from_name(recipe_name)
        assert recipe.repair.lamp_in_every_room
        assert recipe.repair.lamp_lx == 100
        assert recipe.repair.add_ceilings
        assert recipe.surroundings.kind == "drawn"
        settings = {"lamp_in_every_room": "false", "lamp_lx": "0", "add_ceilings": "false"}
        off = recipe_from_name(
            recipe_name, {f"repair.{field}": word for field, word in settings.items()}
        )
        assert recipe.digest("repair") != off.digest("repair")
        assert off.digest("repair") == recipe_from_name(name).digest("repair")


def test_layers_of_lamps_are_stored_again_and_change_no_picture() -> None:
    two, lamps = (recipe_from_name("fast", {"light.groups": word}) for word in ("two", "lamps"))
    assert lamps.picture_digest("light") == two.picture_digest("light")
    assert lamps.digest("light") != two.digest("light")


def test_either_light_mode_requests_light() -> None:
    want = plan.wanted(["mlt_ol"], [])
    assert plan.view_steps(want) == ("truth", "light", "develop", "view")
    assert plan.view_steps(plan.wanted(["opengl_il"], [])) == ("truth", "opengl_il", "view")


def test_no_modes_named_means_all() -> None:
    assert plan.wanted([], []).modes == tuple(Mode)


@pytest.mark.parametrize("words", [(["mlt"], []), ([], ["depths"])])
def test_an_unknown_word_is_refused(words: tuple[list[str], list[str]]) -> None:
    with pytest.raises(BadInput):
        plan.wanted(*words)


def test_few_views_are_spread_over_rooms_best_first() -> None:
    rows = [("a_0", "a", 5.0), ("a_1", "a", 9.0), ("b_0", "b", 1.0), ("c_0", "c", 2.0)]
    assert plan.spread(rows, 3) == ["a_1", "b_0", "c_0"]
    assert plan.spread(rows, 0) == ["a_0", "a_1", "b_0", "c_0"]


@pytest.mark.parametrize(
    "overrides",
    [
        {"light.spp": "0"},
        {"light.nonsense": "1"},
        {"nonsense": "1"},
        {"tone.key": "NaN"},
        {"light": "3"},
    ],
)
def test_a_field_that_does_not_fit_is_refused(overrides: dict[str, str]) -> None:
    with pytest.raises(BadRecipe):
        recipe_from_name("fast", overrides)


def test_the_first_frames_of_a_sequence_are_made_and_pairs_stay_together() -> None:
    rows = [(f"frame_{k:05d}{side}", "a", 0.0) for k in range(3) for side in ("", "_right")]
    recipe = recipe_from_name("fast", {"cameras.source": "walk", "cameras.stereo_m": "0.065"})
    assert plan.chosen_views(rows, 2, recipe) == [row[0] for row in rows[:4]]
    assert plan.chosen_views(rows, 0, recipe) == [row[0] for row in rows]
    sampled = recipe_from_name("fast", {"cameras.stereo_m": "0.1"})
    best = [("a_0", "a", 1.0), ("a_0_right", "a", 1.0), ("b_0", "b", 2.0), ("b_0_right", "b", 2.0)]
    assert plan.chosen_views(best, 1, sampled) == ["b_0", "b_0_right"]


def test_modes_may_be_given_by_name() -> None:
    want = Wanted(modes=("opengl_il", Mode.MLT_OL))  # type: ignore[arg-type]
    assert want.modes == (Mode.OPENGL_IL, Mode.MLT_OL)
    assert plan.view_steps(want) == ("truth", "opengl_il", "light", "develop", "view")
    with pytest.raises(BadInput, match="no such lighting mode"):
        Wanted(modes=("opengl_li",))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("view", "is_developed_again"),
    [("0_0_1", False), ("0_0_1_right", False), ("frame_00001_back", False), ("0_0_1_back", True)],
)
def test_only_stills_that_now_share_their_rig_s_camera_are_developed_again(
    view: str, is_developed_again: bool
) -> None:
    rig = '{"cameras": [{"name": "front"}, {"name": "right"}, {"name": "back"}]}'
    recipe = recipe_from_name("fast", {"rig": rig})
    store = MemoryStore()
    light = Marker(
        step="light",
        house_id="h",
        view_id=view,
        digest="d",
        files=(),
        facts={},
        seconds=0.0,
        worker="",
        attempt=1,
        finished_utc="",
    )
    store.put(keys.marker_key("h", "light", view), light.json_bytes())
    work = Work(store, recipe, "h", HouseCache(), view_id=view)
    digest = run_unless_done("develop", work, lambda _work: StepOutput({})).marker.digest
    before = plan.step_digest(plan.STEPS["develop"], recipe, "h", view, {"light": "d"})
    assert (digest != before) == is_developed_again
