"""A packed root: the same keys and bytes as files, in few requests, and no loss."""

from __future__ import annotations

import io
import tarfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from pbrs_farm.core import keys
from pbrs_farm.core.errors import ObjectMissing, StoreFailed, StoreUnavailable
from pbrs_farm.core.recipe import Recipe, recipe_from_name, with_settings
from pbrs_farm.formats.marker import copy_done, read_marker
from pbrs_farm.run import plan
from pbrs_farm.run.house_cache import HouseCache
from pbrs_farm.run.output_root import as_files, claim_root, finish_house, pull
from pbrs_farm.run.step_cache import StepOutput, Work, drop_radiance, run_unless_done
from pbrs_farm.store import MemoryStore, Store, StoreSettings, store_from_url
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.laid_out import LaidOutStore, one_task
from pbrs_farm.store.object_store import Head, put_done
from pbrs_farm.store.pack import GROUPS, pack_bytes, pack_key
from workers.coordinator.recover import done_steps

RECIPE = recipe_from_name("fast")
HOUSE, VIEW = "studio-0123abcd", "room0_3"
LABELS, LIGHT = ("truth", "opengl_dl", "opengl_il"), ("light", "develop", "view")
# Output of a view's steps; radiance is larger than the first read of a pack.
FILES = {
    "truth": {"depth.png": b"d" * 700, "behind_glass/depth.png": b"", "normal.png": b"n" * 90_000},
    "opengl_dl": {"opengl_dl.png": b"o" * 3000},
    "opengl_il": {"opengl_il.png": b"i" * 3001},
    "light": {"radiance.exr": b"r" * 200_000},
    "develop": {"mlt_il_ol.png": b"m" * 512},
    "view": {"view.json": b"{}", "histogram.json": b"[1]"},
}


class CountingStore(MemoryStore):
    """Counts requests, and stops answering writes after a limit."""

    def __init__(self, most_writes: float = float("inf")) -> None:
        super().__init__()
        self.calls: Counter[str] = Counter()
        self.listed: list[str] = []
        self.most_writes = most_writes

    def _written(self, call: str) -> None:
        self.calls[call] += 1
        self.most_writes -= 1
        if self.most_writes < 0:
            raise StoreUnavailable("killed", "here")

    def put(self, key: str, data: bytes | memoryview) -> None:
        self._written("put")
        super().put(key, data)

    def put_if_absent(self, key: str, data: bytes) -> bool:
        self._written("put")
        return super().put_if_absent(key, data)

    def delete(self, key: str) -> None:
        self._written("delete")
        super().delete(key)

    def get(self, key: str) -> bytes:
        self.calls["get"] += 1
        return super().get(key)

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        self.calls["get"] += 1
        return super().get(key)[start : start + n_bytes]

    def head(self, key: str) -> Head | None:
        self.calls["get"] += 1
        return super().head(key)

    def list(self, prefix: str = "") -> Iterator[str]:
        self.listed.append(prefix)
        return super().list(prefix)


def packed(inner: Store | None = None) -> LaidOutStore:
    store = LaidOutStore(inner if inner is not None else CountingStore())
    claim_root(store, RECIPE, update=False)
    return store


def do(store: Store, *steps: str, view: str = VIEW, recipe: object = RECIPE) -> None:
    """Do steps like the farm; each also reads the outputs of its inputs."""
    work = Work(store, recipe, HOUSE, HouseCache(), view_id=view)  # type: ignore[arg-type]
    for name in steps:
        files = FILES.get(name, {f"{name}.json": b"{}"})
        run_unless_done(name, work, lambda _work, files=files: StepOutput(files))


def house_done(store: Store) -> None:
    for step in ("cameras", "illuminance"):
        run_unless_done(step, Work(store, RECIPE, HOUSE, HouseCache()), lambda _w: StepOutput({}))


def view_done(store: Store, view: str = VIEW) -> None:
    for steps in (LABELS, LIGHT):
        with one_task(store, reads_whole=True) as task_store:
            do(task_store, *steps, view=view)


@pytest.fixture(autouse=True)
def _house_without_source(monkeypatch: pytest.MonkeyPatch) -> None:
    # The steps of a view need their house's marker but not its source.
    monkeypatch.setattr("pbrs_farm.run.step_cache.extra_inputs", lambda _name, _work: None)


def prepared(inner: Store | None = None) -> LaidOutStore:
    store = packed(inner)
    run_unless_done(
        "house",
        Work(store, RECIPE, HOUSE, HouseCache()),
        lambda _w: StepOutput({"house.json": b"{}"}),
    )
    house_done(store)
    return store


def all_of(store: Store) -> dict[str, bytes]:
    """Every object of the houses by key, markers without their clocks."""
    objects = {}
    for key in store.list("houses/"):
        marker = read_marker(store, key) if "/done/" in key else None
        calm = {"seconds": 0.0, "worker": "", "finished_utc": ""}
        objects[key] = (
            store.get(key) if marker is None else marker.model_copy(update=calm).json_bytes()
        )
    return objects


def test_a_packed_root_holds_the_objects_of_a_root_of_files() -> None:
    files = MemoryStore()
    claim_root(files, RECIPE, update=False)
    run_unless_done(
        "house",
        Work(files, RECIPE, HOUSE, HouseCache()),
        lambda _w: StepOutput({"house.json": b"{}"}),
    )
    house_done(files)
    store = prepared()
    for layout in (files, store):
        view_done(layout)
        view_done(layout, "room0_4")
        finish_house(layout, HOUSE)
    assert all_of(store) == all_of(files)
    folder = keys.view_key(HOUSE, VIEW)
    assert sorted(store.list(folder)) == sorted(files.list(folder))
    done = keys.house_key(HOUSE, "done/")
    assert sorted(store.list(done)) == sorted(files.list(done))
    for key in files.list(folder):
        head = store.head(key)
        assert head is not None
        assert head.n_bytes == len(files.get(key))
        assert store.get_range(key, 1, 5) == files.get(key)[1:6]


def test_recover_finds_the_markers_without_a_list_of_views() -> None:
    inner = CountingStore()
    store = prepared(inner)
    view_done(store)
    expected = {keys.marker_name(step, VIEW) for step in (*LABELS, *LIGHT)}
    inner.listed.clear()
    for _has_manifest in (False, True):
        names = done_steps(store, [HOUSE, "another"])
        assert names.keys() == {HOUSE}
        assert names[HOUSE] >= expected | {"house"}
        finish_house(store, HOUSE)
    assert all(
        "/done/" in prefix or "/packs/" in prefix or "unfinished" in prefix
        for prefix in inner.listed
    )


def test_every_step_of_a_view_has_a_group() -> None:
    steps = {name for name, step in plan.STEPS.items() if step.per_view}
    assert steps == {step for group in GROUPS.values() for step in group}


def test_a_view_costs_three_writes_and_at_most_nine_reads() -> None:
    inner = CountingStore()
    store = prepared(inner)
    views = [f"room0_{n}" for n in range(4)]
    inner.calls.clear()
    inner.listed.clear()
    for steps in (LABELS, LIGHT):
        with one_task(store, reads_whole=True) as task_store:
            for view in views:
                do(task_store, *steps, view=view)
    assert inner.calls["put"] == 3 * len(views)
    with one_task(store, reads_whole=False) as task_store:
        finish_house(task_store, HOUSE)
    assert inner.calls["put"] == 3 * len(views) + 1
    assert inner.calls["get"] <= 9 * len(views)
    # Neither views/ nor any other house is ever listed.
    assert inner.listed
    assert all(HOUSE in prefix and "/views/" not in prefix for prefix in inner.listed)


@pytest.mark.parametrize("n_writes", range(4))
def test_killed_at_any_write_the_next_run_makes_the_rest_and_loses_nothing(n_writes: int) -> None:
    inner = CountingStore()
    store = prepared(inner)
    whole = prepared()
    view_done(whole)
    inner.most_writes = n_writes
    with pytest.raises(StoreUnavailable) if n_writes < 3 else one_task(inner, reads_whole=False):
        view_done(store)
    before = all_of(store)
    inner.most_writes = float("inf")
    # Every marker has its files.
    for key in before:
        if "/done/" in key and (marker := read_marker(store, key)) is not None:
            assert {file.key for file in marker.files} <= before.keys()
    again = LaidOutStore(inner)
    view_done(again)
    assert all_of(again) == all_of(whole)
    assert before.items() <= all_of(again).items()


def made_and_dropped(store: Store, recipe: Recipe = RECIPE) -> list[str]:
    """Finish a view and remove its light. Returns the rendered steps."""
    made = []
    for steps in (LABELS, LIGHT):
        with one_task(store, reads_whole=True) as task_store:
            work = Work(task_store, recipe, HOUSE, HouseCache(), view_id=VIEW)
            for name in steps:
                output = StepOutput(FILES[name])
                if not run_unless_done(name, work, lambda _work, output=output: output).was_done:
                    made.append(name)
            if steps == LIGHT:
                drop_radiance(work)
    return made


def home_of_files(inner: CountingStore) -> Store:
    claim_root(inner, RECIPE, update=False)
    for step in ("house", "cameras", "illuminance"):
        run_unless_done(step, Work(inner, RECIPE, HOUSE, HouseCache()), lambda _w: StepOutput({}))
    return inner


@pytest.mark.parametrize("layout", [prepared, home_of_files])
@pytest.mark.parametrize("n_writes", range(18))
def test_light_is_dropped_and_traced_once_whenever_a_run_is_killed(
    layout: Callable[[CountingStore], Store], n_writes: int
) -> None:
    inner = CountingStore()
    store = layout(inner)
    inner.most_writes = n_writes
    with suppress(StoreUnavailable):
        made_and_dropped(store)
    inner.most_writes = float("inf")
    light = keys.marker_key(HOUSE, "light", VIEW)
    was_traced = read_marker(store, light) is not None
    again = LaidOutStore(inner)
    made = made_and_dropped(again)
    assert ("light" in made) == (not was_traced)
    radiance = keys.view_key(HOUSE, VIEW, "radiance.exr")
    assert radiance not in list(again.list("houses/"))
    marker = read_marker(again, light)
    assert marker is not None
    assert marker.files == ()
    finish_house(again, HOUSE)
    manifest = again.get(keys.house_key(HOUSE, keys.MANIFEST))
    assert b"mlt_il_ol.png" in manifest
    assert b"radiance.exr" not in manifest
    for key in again.list("houses/"):
        if "/done/" in key and (marker := read_marker(again, key)) is not None:
            assert all(again.head(file.key) is not None for file in marker.files)
    assert made_and_dropped(again) == []


@pytest.mark.parametrize("layout", [prepared, home_of_files])
def test_dropped_light_is_traced_again_only_for_other_pictures(
    layout: Callable[[CountingStore], Store],
) -> None:
    store = layout(CountingStore())
    made_and_dropped(store)
    other = with_settings(RECIPE, {"tone.contrast": 1.2})
    assert made_and_dropped(store, other) == ["light", "develop", "view"]
    assert made_and_dropped(store, other) == []
    # Light that failed pictures need stays.
    store.delete(keys.marker_key(HOUSE, "develop", VIEW))
    with one_task(store, reads_whole=True) as task_store:
        do(task_store, "light", recipe=other)
        drop_radiance(Work(task_store, other, HOUSE, HouseCache(), view_id=VIEW))
    assert store.get(keys.view_key(HOUSE, VIEW, "radiance.exr")) == FILES["light"]["radiance.exr"]


def test_a_step_that_fails_leaves_those_before_it_done() -> None:
    store = prepared()

    def task() -> None:
        with one_task(store, reads_whole=True) as task_store:
            do(task_store, "truth", "opengl_dl")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        task()
    assert read_marker(store, keys.marker_key(HOUSE, "opengl_dl", VIEW)) is not None


def test_outputs_are_visible_to_their_task_immediately_and_to_others_complete() -> None:
    store = prepared()
    with one_task(store, reads_whole=True) as task_store:
        do(task_store, "truth")
        assert (
            task_store.get(keys.view_key(HOUSE, VIEW, "depth.png")) == FILES["truth"]["depth.png"]
        )
        assert store.head(keys.view_key(HOUSE, VIEW, "depth.png")) is None
        # Light takes long: earlier outputs are written first.
        read_marker(task_store, keys.marker_key(HOUSE, "light", VIEW))
        assert read_marker(LaidOutStore(store.inner), keys.marker_key(HOUSE, "truth", VIEW))


def test_two_writers_of_one_group_both_keep_their_outputs() -> None:
    store = prepared()
    with one_task(store, reads_whole=True) as a, one_task(store, reads_whole=True) as b:
        do(a, "truth", "opengl_dl")
        do(b, "truth", "opengl_il")
    for step in LABELS:
        assert read_marker(store, keys.marker_key(HOUSE, step, VIEW)) is not None
    file = keys.view_key(HOUSE, VIEW, "opengl_dl.png")
    assert store.get(file) == FILES["opengl_dl"]["opengl_dl.png"]
    assert len([k for k in store.list("houses/") if k.endswith("opengl_dl.png")]) == 1


def test_a_repeated_step_keeps_the_others_of_its_pack() -> None:
    store = prepared()
    view_done(store)
    store.delete(keys.marker_key(HOUSE, "truth", VIEW))
    with pytest.raises(ObjectMissing):
        store.get(keys.view_key(HOUSE, VIEW, "depth.png"))
    assert (
        store.get(keys.view_key(HOUSE, VIEW, "opengl_il.png"))
        == FILES["opengl_il"]["opengl_il.png"]
    )
    with one_task(store, reads_whole=True) as task_store:
        do(task_store, "truth")
    assert store.get(keys.view_key(HOUSE, VIEW, "depth.png")) == FILES["truth"]["depth.png"]
    # Once more, now from its own pack; the last step rewrites the pack.
    for step in LABELS:
        store.delete(keys.marker_key(HOUSE, step, VIEW))
    packs = [
        k for k in store.inner.list("houses/") if "/packs/labels." in k or "/packs/truth." in k
    ]
    assert packs == []


def test_stale_pictures_give_way_to_those_of_new_light() -> None:
    store = prepared()
    view_done(store)
    # With another recipe light is made again, and so are its developed pictures.
    store.delete(keys.marker_key(HOUSE, "light", VIEW))
    more_samples = with_settings(RECIPE, {"light.spp": 3})
    with one_task(store, reads_whole=True) as task_store:
        do(task_store, *LIGHT, recipe=more_samples)
    files = MemoryStore()
    claim_root(files, RECIPE, update=False)
    for step in ("house", "cameras", "illuminance"):
        key = keys.marker_key(HOUSE, step)
        files.put(key, store.get(key))
    with one_task(files, reads_whole=True) as task_store:
        do(task_store, *LABELS)
        do(task_store, *LIGHT, recipe=more_samples)
    for step in LIGHT:
        key = keys.marker_key(HOUSE, step, VIEW)
        marker, expected = read_marker(store, key), read_marker(files, key)
        assert marker is not None
        assert expected is not None
        assert marker.digest == expected.digest
        assert [store.get(file.key) for file in marker.files] == [
            files.get(f.key) for f in marker.files
        ]


def test_a_pack_rewritten_under_a_reader_gives_the_new_bytes() -> None:
    store = prepared()
    reader = LaidOutStore(store.inner)
    view_done(store)
    key = keys.view_key(HOUSE, VIEW, "normal.png")
    assert reader.get(key) == FILES["truth"]["normal.png"]
    store.delete(keys.marker_key(HOUSE, "opengl_dl", VIEW))
    assert reader.get(key) == FILES["truth"]["normal.png"]


def test_a_pack_is_a_tar_of_the_views_folder() -> None:
    store = prepared()
    view_done(store)
    data = store.inner.get(pack_key(HOUSE, VIEW, "labels"))
    with tarfile.open(fileobj=io.BytesIO(data)) as tar:
        names = tar.getnames()
        file = tar.extractfile("normal.png")
        assert file is not None
        assert file.read() == FILES["truth"]["normal.png"]
    assert names[0] == "index.json"
    assert {"done/truth.json", "behind_glass/depth.png", "opengl_dl.png"} <= set(names)


def test_houses_lie_under_two_digits_of_their_hash() -> None:
    store = prepared()
    view_done(store)
    digits = keys.sha256(HOUSE.encode())[:2]
    inner = [*store.inner.list("houses/")]
    assert inner
    assert all(key.startswith(f"houses/{digits}/{HOUSE}/") for key in inner)


def test_an_older_root_stays_as_it_began() -> None:
    inner = MemoryStore()
    claim_root(inner, RECIPE, update=False)
    inner.put(keys.view_key(HOUSE, VIEW, "depth.png"), b"old")
    store = LaidOutStore(inner)
    claim_root(store, RECIPE, update=False)
    assert not store.is_packed
    assert store.get(keys.view_key(HOUSE, VIEW, "depth.png")) == b"old"
    put_done(
        store, keys.marker_key(HOUSE, "truth", VIEW), b"{}", {keys.view_key(HOUSE, VIEW, "a"): b"1"}
    )
    assert inner.get(keys.view_key(HOUSE, VIEW, "a")) == b"1"


def test_a_root_that_is_not_there_yet_may_become_packed_while_it_is_looked_at() -> None:
    inner = MemoryStore()
    early = LaidOutStore(inner)
    assert [*early.list()] == []
    view = prepared(inner)
    view_done(view)
    assert early.head(keys.view_key(HOUSE, VIEW, "view.json")) is not None


def test_a_later_layout_is_refused() -> None:
    inner = MemoryStore()
    inner.put("layout.json", b'{"format": 2, "layout": "packed"}')
    with pytest.raises(StoreFailed, match="newer"):
        LaidOutStore(inner).get("houses/h/house.json")
    inner.put(pack_key(HOUSE, VIEW, "light"), b"no tar")
    inner.put("layout.json", b'{"format": 1, "layout": "packed"}')
    with pytest.raises(StoreFailed, match="not a pack"):
        LaidOutStore(inner).get(keys.view_key(HOUSE, VIEW, "radiance.exr"))


def test_a_folder_is_packed_on_request_and_recognised_later(tmp_path: Path) -> None:
    settings = StoreSettings(layout="packed")
    store = store_from_url(str(tmp_path / "root"), settings)
    prepared_store = prepared(store.inner if isinstance(store, LaidOutStore) else store)
    view_done(prepared_store)
    reopened = store_from_url(str(tmp_path / "root"))
    assert isinstance(reopened, LaidOutStore)
    assert all_of(reopened) == all_of(prepared_store)
    # As files: for verbs that read folders, and permanently.
    with as_files(str(tmp_path / "root"), replace(settings, layout="")) as folder:
        assert (folder / keys.view_key(HOUSE, VIEW, "depth.png")).read_bytes() == b"d" * 700
    assert pull(reopened, tmp_path / "copy")[1] == 0
    assert pull(reopened, tmp_path / "copy")[0] == 1  # the recipe
    assert all_of(FolderStore(tmp_path / "copy")) == all_of(reopened)


def test_a_view_is_copied_from_one_layout_to_the_other() -> None:
    store, files = prepared(), MemoryStore()
    view_done(store)
    for step in (*LABELS, *LIGHT):
        copy_done(store, files, keys.marker_key(HOUSE, step, VIEW))
    back = packed()
    for step in (*LABELS, *LIGHT):
        copy_done(files, back, keys.marker_key(HOUSE, step, VIEW))
    assert all_of(back) == all_of(files)


def test_an_index_longer_than_the_first_read_is_read_completely() -> None:
    store = packed()
    members = {f"layer_{n:04d}.png": b"x" for n in range(2000)}
    data = pack_bytes({"truth": {"done/truth.json": b"{}", **members}})
    store.inner.put(pack_key(HOUSE, VIEW, "labels"), data)
    assert store.get(keys.view_key(HOUSE, VIEW, "layer_1999.png")) == b"x"
