"""The table of passes: order, groups and versions take effect."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.core.catalogue import EMPTY
from pbrs_farm.core.edits import RemoveItems
from pbrs_farm.core.recipe import Recipe, field_paths, picture_groups, with_settings
from pbrs_farm.prepare import finished_house as finishing
from pbrs_farm.prepare import passes as passes_module
from pbrs_farm.prepare.finished_house import HouseBeforeEdits, finished_house
from pbrs_farm.prepare.passes import GROUPS, PASS, PASSES, cache_key, step_depends
from pbrs_farm.prepare.source import resolve, variants
from pbrs_farm.prepare.source_ref import SourceRef
from pbrs_farm.run import plan
from workers.job import work_version

# Runs passes.py with one more function and row, before it is imported.
ADDED = '''
import sys
from pathlib import Path
from types import ModuleType

text = Path(sys.argv[1]).read_text()
table, end = "PASSES: Final = (", "\\n)\\n\\nPASS: Final"
assert table in text and end in text
function = """
def _sign(work: Preparation) -> Preparation:
    return replace(work, current=replace(work.house, name=f"signed {work.recipe.tone.key}"))


"""
row = """\\n    Pass("sign", 7, _sign, lambda _source, _recipe: True, groups=("tone",)),"""
module = ModuleType("pbrs_farm.prepare.passes")
import pbrs_farm.prepare
sys.modules[module.__name__] = pbrs_farm.prepare.passes = module
exec(compile(text.replace(table, function + table).replace(end, row + end), sys.argv[1], "exec"), module.__dict__)

from pbrs_farm.core.recipe import Recipe, with_settings
from pbrs_farm.prepare.finished_house import finished_house
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run import plan
from workers.job import work_version

source, recipe = resolve("builtin"), Recipe()
other = with_settings(recipe, {"tone.key": 0.5})
assert finished_house(source, other).house.name == "signed 0.5"
assert module.versions_of_passes()["sign"] == 7
assert "tone" in plan.STEPS["house"].groups
assert module.cache_key(source, recipe) != module.cache_key(source, other)
assert ["sign", 7] in module.step_depends(source, recipe)
print(work_version())
'''


@pytest.mark.kinds("pass")
def test_a_pass_added_in_one_file_runs_and_is_part_of_digests() -> None:
    words = [sys.executable, "-c", ADDED, str(passes_module.__file__)]
    done = subprocess.run(words, capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() != work_version()


def names_of(source: SourceRef, recipe: Recipe) -> list[str]:
    return [p.name for p in PASSES if p.is_needed(source, recipe)]


def test_a_home_goes_through_the_passes_that_it_needs() -> None:
    source, recipe = resolve("builtin"), Recipe()
    assert names_of(source, recipe) == ["read", "repair"]
    edited = variants(source, [3])[0].edited(RemoveItems(items=("sofa",)))
    full = with_settings(recipe, {"dress.furnish": "empty", "surroundings.kind": "drawn"})
    all_passes = ["read", "furnish", "dress", "repair", "surroundings", "edits"]
    assert names_of(edited, full) == all_passes
    hung = with_settings(recipe, {"dress.float_share": 0.1})
    assert names_of(source, hung) == ["read", "repair", "float"]
    plan_of_others = source.model_copy(update={"kind": "plan"})
    assert names_of(plan_of_others, recipe) == ["read", "stand-ins", "repair"]


@pytest.mark.parametrize("kind", ["object", "plugin"])
def test_an_object_and_a_home_of_a_plugin_are_only_read(kind: str) -> None:
    source = resolve("builtin").model_copy(update={"kind": kind})
    full = with_settings(
        Recipe(), {"dress.seed": 2, "dress.float_share": 0.1, "dress.furnish": "empty"}
    )
    assert names_of(source, full) == ["read"]


def test_the_key_of_a_cache_differs_with_every_field_that_a_pass_reads() -> None:
    source, recipe = resolve("builtin"), Recipe()
    first_key = cache_key(source, recipe)
    assert cache_key(source, with_settings(recipe, {"light.spp": 7})) == first_key
    changes = {"read.strict": True, "dress.mess": 0.9, "repair.add_ceilings": True}
    changes |= {"surroundings.kind": "drawn"}
    assert {path.partition(".")[0] for path in changes} == set(GROUPS)
    assert set(changes) <= set(field_paths())
    for path, value in changes.items():
        assert cache_key(source, with_settings(recipe, {path: value})) != first_key, path


def test_the_share_of_the_users_library_counts_only_if_there_is_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (source,) = variants(resolve("builtin"), [1])
    recipes = [with_settings(Recipe(), {"dress.library_share": share}) for share in (0.5, 0.2)]
    for own, n_digests in ((frozenset(), 1), (frozenset({"mine#chair"}), 2)):
        library = replace(EMPTY, own=own)
        monkeypatch.setattr(passes_module, "catalogue_of", lambda _fields, held=library: held)
        assert len({str(step_depends(source, recipe)) for recipe in recipes}) == n_digests


def test_the_version_of_plan_readers_affects_only_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    built_in, recipe = resolve("builtin"), Recipe()
    sources = (built_in, built_in.model_copy(update={"kind": "plan"}))
    before = [step_depends(source, recipe) for source in sources]
    monkeypatch.setattr(passes_module, "PLANS_VERSION", 99)
    assert [step_depends(s, recipe) == b for s, b in zip(sources, before, strict=True)] == [
        True,
        False,
    ]


def test_every_group_of_a_pass_affects_pictures() -> None:
    assert set(GROUPS) <= set(picture_groups())
    assert set(plan.STEPS["house"].groups) <= set(GROUPS)


def test_workers_of_other_passes_are_of_another_version(monkeypatch: pytest.MonkeyPatch) -> None:
    version = work_version.__wrapped__()
    assert work_version.__wrapped__() == version
    versions = passes_module.versions_of_passes()
    assert set(versions) == {*PASS, "plans"}
    for name in versions:
        raised = versions | {name: versions[name] + 1}
        monkeypatch.setattr("pbrs_farm.prepare.passes.versions_of_passes", lambda r=raised: r)
        assert work_version.__wrapped__() != version, name


def test_homes_that_differ_only_in_edits_are_prepared_once(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []
    monkeypatch.setattr(finishing, "note_step", lambda _file, step: begun.append(step))
    source, recipe, cache = resolve("builtin"), Recipe(), HouseBeforeEdits()
    house = finished_house(source, recipe).house
    removed = [item.id for item in house.items][:2]
    edited = [source.edited(RemoveItems(items=(item,))) for item in removed]
    begun.clear()
    for home in edited:
        finished = finished_house(home, recipe, before_edits=cache).house
        assert finished.id == home.house_id
        assert sum(item.is_removed for item in finished.items) == 1
    assert begun == ["read", "repair", "edits", "edits"]
    cache.clear()
    assert cache.get(source, recipe) is None


@pytest.mark.parametrize("name", [p.name for p in PASSES])
def test_another_version_of_a_pass_renews_the_houses_that_use_it(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    changed = {
        "dress.furnish": "empty",
        "dress.catalogue": "generated",
        "dress.open_share": 0.1,
        "dress.float_share": 0.1,
        "surroundings.kind": "drawn",
    }
    full = with_settings(Recipe(), changed)
    source = resolve("builtin").model_copy(update={"kind": "plan", "dress_seed": 1})
    source = source.edited(RemoveItems(items=("sofa",)))
    bare = resolve("builtin")
    before, before_bare = step_depends(source, full), step_depends(bare, Recipe())
    raised = [replace(p, version=p.version + (p.name == name)) for p in PASSES]
    monkeypatch.setattr("pbrs_farm.prepare.passes.PASSES", tuple(raised))
    assert step_depends(source, full) != before
    assert (step_depends(bare, Recipe()) != before_bare) == (name in ("read", "repair"))
    # A plugin's home may use any pass.
    of_plugin = bare.model_copy(update={"kind": "plugin"})
    monkeypatch.undo()
    of_before = step_depends(of_plugin, Recipe())
    monkeypatch.setattr("pbrs_farm.prepare.passes.PASSES", tuple(raised))
    assert step_depends(of_plugin, Recipe()) != of_before


def test_plugins_of_furniture_name_repair_which_may_add_their_lamps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    source = resolve("builtin")
    before = step_depends(source, Recipe())
    monkeypatch.setattr(
        passes_module,
        "marks_in_digest",
        lambda group, _names: ["lamps of shop 1"] if group == "furniture" else [],
    )
    assert step_depends(source, Recipe()) != before
