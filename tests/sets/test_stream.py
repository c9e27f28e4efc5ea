"""A set as a stream: equal bytes for any readers, a bounded cache, light drawn anew, one error for other sets."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

import pbrs_farm as pf
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.formats.serialise import json_bytes
from pbrs_farm.images import array_from_png
from pbrs_farm.prepare.source import resolve
from pbrs_farm.raycast.variant import choose_variant
from pbrs_farm.run.local import run_local
from pbrs_farm.run.local_run import Run
from pbrs_farm.run.plan import wanted
from pbrs_farm.run.relight import LampFactor, RelightLayers, relit
from pbrs_farm.sets import stream_renderer
from pbrs_farm.sets.stream import Stream
from pbrs_farm.sets.stream_cache import CachedView, StreamCache, bytes_of_unit
from pbrs_farm.sets.stream_farm import fetched_views, planned_rows
from pbrs_farm.sets.stream_plan import StreamHome, StreamPlan, drawn_light
from pbrs_farm.sets.stream_renderer import StreamRenderer
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.transport.develop.mode_pictures import LinearAovs
from pbrs_farm.views.stored_layers import ViewFacts
from pbrs_farm.views.view_sample import SampleRequest
from tests.sets.streams import digest, streamed

renders = [
    pytest.mark.long,
    pytest.mark.skipif(
        choose_variant().startswith("scalar"), reason="the kernels need LLVM or CUDA"
    ),
]


def plan(folder: Path, n_homes: int = 5, **fields: Any) -> StreamPlan:
    """A plan of homes with three views each, for a cache without a renderer."""
    home = StreamHome("builtin", resolve("builtin"), recipe_from_name("preview"), 3)
    request = SampleRequest(("colour", "depth"))
    made = StreamPlan("small", (home,) * n_homes, request, (), 0, 4, folder / "small-1", 10**9, 1)
    return replace(made, **fields)


def view(value: float) -> CachedView:
    """A view of 4 x 3 pixels with two lamps and daylight."""
    image = np.full((3, 4, 3), value, np.float32)
    light = RelightLayers(
        LinearAovs(image, 0 * image, 0 * image + 0.5, image), {1: image, 4: 2 * image}
    )
    pose = tuple(map(tuple, np.eye(4).tolist()))
    facts = ViewFacts("home-1", "0_0_0", "0_0", (4, 3), pose[:3], pose)
    facts = replace(facts, K=tuple(tuple(row[:3]) for row in pose[:3]))
    labels = {"depth": np.full((3, 4), 1500, np.uint16)}
    return CachedView(facts, labels, {}, light, recipe_from_name("preview").tone)


def test_a_stream_of_a_set_stores_every_lamp_also_those_that_its_pictures_have_off(
    tmp_path: Path,
) -> None:
    text = '[render]\nrecipe = "fast"\nset = ["emission.lamps_on=0.5"]\n'
    (tmp_path / "dim.toml").write_text(text + '[part.views]\nhomes = ["builtin"]\nviews = 2\n')
    stream = pf.stream(tmp_path / "dim.toml", layers=("colour",), cache=tmp_path / "cache")
    assert [home.recipe.emission.lamps_on for home in stream.plan.homes] == [1.0]


def test_each_epoch_has_each_view_once_in_another_order(tmp_path: Path) -> None:
    small = plan(tmp_path)
    orders = [small.order(epoch).tolist() for epoch in range(3)]
    assert all(sorted(order) == [[h, k] for h in range(5) for k in range(3)] for order in orders)
    assert orders[0] != orders[1] != orders[2]
    assert orders == [plan(tmp_path).order(epoch).tolist() for epoch in range(3)]
    assert orders[0] != plan(tmp_path, seed=1).order(0).tolist()


def test_a_view_is_used_for_reuse_epochs_and_homes_take_turns(tmp_path: Path) -> None:
    small = plan(tmp_path, n_homes=8)
    generations = [[small.unit(home, epoch)[1] for home in range(8)] for epoch in range(9)]
    assert generations[0] == [0] * 8
    for before, after in pairwise(generations):
        assert sum(a > b for a, b in zip(after, before, strict=True)) == 2
    assert generations[8] == [2] * 8


def test_renderers_work_ahead_to_each_homes_next_views(tmp_path: Path) -> None:
    small = plan(tmp_path, n_homes=4)
    ranks = small.ranks([(8, 0, 4)])
    assert sorted(ranks) == [(home, number) for home in range(4) for number in (2, 3)]
    now = {small.unit(home, 8) for home in range(4)}
    assert set(list(ranks)[:4]) == now


def test_a_renderer_goes_on_after_a_unit_that_took_long(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small, n_rendered = plan(tmp_path), 0
    cache = StreamCache(small.folder, small.cache_bytes)

    def render(_renderer: StreamRenderer) -> bool:
        nonlocal n_rendered
        n_rendered += 1
        time.sleep(0.1)
        return True

    monkeypatch.setattr(stream_renderer, "_END_S", 0.05)
    monkeypatch.setattr(StreamRenderer, "render_next", render)
    monkeypatch.setattr(cache, "places", lambda: [(0, 0, 4)] if n_rendered < 3 else [])
    StreamRenderer(small, cache).serve()
    assert n_rendered == 3


def test_a_picture_is_never_without_light() -> None:
    for seed in range(300):
        draw = drawn_light(np.random.default_rng(seed), [2, 5], has_daylight=seed % 2 == 0)
        lamps = sum(map(sum, draw.lamps.values()))
        assert lamps + sum(draw.outdoor) * (seed % 2 == 0) > 0
        assert drawn_light(np.random.default_rng(seed), [], has_daylight=True).outdoor[0] > 0


def test_each_epoch_draws_other_light_and_labels_stay(tmp_path: Path) -> None:
    small = plan(tmp_path, n_homes=1)
    cache = StreamCache(small.folder, small.cache_bytes)
    cache.put((0, 0), bytes_of_unit([view(k + 1.0) for k in range(3)]), lambda _path: 0.0)
    epochs = [sorted(Stream(small, e), key=lambda s: s["colour"].tobytes()) for e in range(4)]
    lights = {sample["light"] for samples in epochs for sample in samples}
    assert len(lights) == 12
    assert all((sample["depth"] == 1.5).all() for samples in epochs for sample in samples)
    again = [digest(sample) for sample in Stream(small, 2)]
    assert again == [digest(sample) for sample in Stream(small, 2)]
    assert [digest(s) for s in Stream(small, 2, start=1)] == again[1:]


def test_the_exposure_of_a_camera_that_errs_is_not_drawn_again(tmp_path: Path) -> None:
    small = plan(tmp_path, n_homes=1)
    recipe = recipe_from_name("preview", {"tone.camera": "snapshot"})
    tones = [recipe.camera_of("home-1", f"0_0_{k}").tone for k in range(3)]
    views = [replace(view(1.0), tone=tone) for tone in tones]
    cache = StreamCache(small.folder, small.cache_bytes)
    cache.put((0, 0), bytes_of_unit(views), lambda _path: 0.0)
    samples = [sample for epoch in range(4) for sample in Stream(small, epoch)]
    assert {sample["exposure_ev"] for sample in samples} == {0.0}
    cache.put((0, 1), bytes_of_unit([view(1.0)] * 3), lambda _path: 0.0)
    assert len({sample["exposure_ev"] for sample in Stream(small, 4)}) == 3


def test_a_home_without_views_is_replaced_and_none_is_an_error(tmp_path: Path) -> None:
    small = plan(tmp_path, n_homes=2, reuse=1)
    cache = StreamCache(small.folder, small.cache_bytes)
    cache.put((0, 0), bytes_of_unit([], "home.glb: no room"), lambda _path: 0.0)
    cache.put((1, 0), bytes_of_unit([view(1.0)]), lambda _path: 0.0)
    assert len(list(Stream(small))) == 6
    cache.put((0, 1), bytes_of_unit([], "home.glb: no room"), lambda _path: 0.0)
    cache.put((1, 1), bytes_of_unit([], "home.glb: no room"), lambda _path: 0.0)
    with pytest.raises(BadInput, match=r"no home has a view: home\.glb: no room"):
        Stream(small, 1)[0]


def size_of(folder: Path) -> int:
    """Bytes of all files below a folder."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def test_the_cache_stays_below_its_bound_and_keeps_what_is_used_first(tmp_path: Path) -> None:
    cache = StreamCache(tmp_path / "a", 10_000)
    other = StreamCache(tmp_path / "b", 10_000)
    other.put((0, 0), bytes(3000), lambda _path: 0.0)

    def distance(path: Path) -> float:
        return math.inf if path.parents[1].name == "b" else float(path.stem.partition("-")[0])

    for unit in (5, 3, 8, 1, 9, 2):
        written = cache.put((unit, 0), bytes(3000), distance)
        assert written == (unit != 9)
        assert size_of(tmp_path) <= 10_000
    assert [int(path.name[:6]) for path in sorted(cache.folder.glob("units/*"))] == [1, 2, 3]
    assert not other.path((0, 0)).exists()


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ('cameras = "walk"', "frames of a film"),
        ("stereo = 0.1", "pictures of a rig"),
        ('set = ["sensor.preset=phone"]', "pictures of stored light have no sensor"),
        ('set = ["light.integrator=metropolis"]', 'lamps are stored by "path"'),
    ],
)
def test_a_set_that_cannot_be_streamed_is_one_error(tmp_path: Path, line: str, text: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(f'[part.views]\nhomes = ["builtin"]\n{line}\n')
    with pytest.raises(BadInput, match=r"mine\.toml: part\.views: cannot be streamed") as error:
        pf.stream(file, cache=tmp_path / "cache")
    assert text in str(error.value)
    assert not (tmp_path / "cache").exists()


def test_layers_of_light_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('[part.views]\nhomes = ["builtin"]\n')
    with pytest.raises(BadInput, match="shading: is made of the rendered light"):
        pf.stream(file, layers=("colour", "shading"))
    with pytest.raises(BadInput, match="colours: no such layer"):
        pf.stream(file, layers="colours")


@pytest.fixture(scope="module")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Iterable[Stream]:
    """A stream whose first epochs are rendered."""
    folder = tmp_path_factory.mktemp("stream")
    stream = streamed(folder, folder / "cache")
    list(stream.epoch(1))
    list(stream)
    yield stream
    stream.close()


TRAINER = """
import sys
from pathlib import Path
from tests.sets.streams import digest, streamed

for epoch in (0, 1):
    stream = streamed(Path(sys.argv[1]), Path(sys.argv[2])).epoch(epoch)
    for sample in stream:
        print(digest(sample), flush=True)
stream.close()
"""


def trainer(folder: Path, cache: Path) -> subprocess.Popen[str]:
    """Start a process that prints the digest of each sample."""
    return subprocess.Popen(
        [sys.executable, "-c", TRAINER, str(folder), str(cache)],
        stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip


class TestRendered:
    pytestmark = renders

    def test_a_killed_trainer_resumes_with_the_same_bytes(
        self, rendered: Stream, tmp_path: Path
    ) -> None:
        folder = rendered.plan.folder.parents[1]
        cache = tmp_path / "cache"
        with trainer(folder, cache) as process:
            assert process.stdout is not None
            first = process.stdout.readline().strip()
            renderers = psutil.Process(process.pid).children()
            process.kill()
        for child in renderers:
            child.kill()
            child.wait()
        for file in cache.glob("*/units/*"):
            assert file.suffix == ".npz"
            with np.load(file) as arrays:
                assert all(arrays[name] is not None for name in arrays.files)
        with trainer(folder, cache) as process:
            assert process.stdout is not None
            lines = process.stdout.read().split()
        expected = [digest(sample) for epoch in (0, 1) for sample in rendered.epoch(epoch)]
        assert [first, *lines[1:]] == lines == expected

    @pytest.mark.study
    def test_any_number_of_workers_gives_the_same_bytes(self, rendered: Stream) -> None:
        from torch.utils.data import DataLoader

        for epoch in (0, 1):
            batches = [
                list(DataLoader(rendered.epoch(epoch), batch_size=3, num_workers=n)) for n in (0, 2)
            ]
            for one, two in zip(*batches, strict=True):
                assert one["id"] == two["id"]
                assert one["light"] == two["light"]
                for name in ("colour", "normal", "valid", "albedo", "K"):
                    assert (one[name] == two[name]).all()
            alone = np.stack([sample["colour"] for sample in rendered.epoch(epoch)])
            assert (np.concatenate([b["colour"].numpy() for b in batches[1]]) == alone).all()

    def test_a_picture_is_that_of_relight(self, rendered: Stream, tmp_path: Path) -> None:
        home = rendered.plan.homes[0]
        recipe = home.recipe_of(0, 0, 0)
        out = tmp_path / "out"
        run_local(Run((), str(out), recipe, wanted(["mlt_il_ol"], [], 2), sources=[home.source]))
        samples = [
            s for e in (0, 1) for s in rendered.epoch(e) if s["house"] == home.source.house_id
        ]
        assert len({sample["light"] for sample in samples}) == 4
        for sample in (s for s in samples if s["generation"] == 0):
            ev = {"exposure_ev": sample["exposure_ev"]}
            exposed = recipe.model_copy(update={"tone": recipe.tone.model_copy(update=ev)})
            (out / "recipe.json").write_bytes(json_bytes(exposed))
            words = sample["light"].split(" --lamp ")
            lamps = []
            for word in words[1:]:
                number, _, factors = word.partition("=")
                lamps.append(LampFactor(number, tuple(map(float, factors.split(",")))))
            outdoor = tuple(map(float, words[0].removeprefix("--outdoor ").split(",")))
            png = relit(
                out / "houses" / Path(*sample["id"].split("/")[:1]) / "views" / sample["id"].split("/")[1],
                indoor=1.0, outdoor=outdoor, denoise=True, lamps=lamps,
            )  # fmt: skip
            difference = np.abs(array_from_png(png).astype(int) - sample["colour"])
            assert difference.max() <= 1
            assert (difference > 0).mean() < 0.02

    def test_views_of_a_farm_are_taken_from_its_store(
        self, rendered: Stream, tmp_path: Path
    ) -> None:
        home, want = rendered.plan.homes[0], wanted(["mlt_il_ol"], [], 2)
        out = tmp_path / "out"
        run_local(Run((), str(out), home.recipe, want, sources=[home.source]))
        store, house = FolderStore(out), home.source.house_id
        rows = planned_rows(store, home, want, lambda: True)
        finished = [
            name
            for name, _room, _score in rows
            if (out / "houses" / house / "views" / name).exists()
        ]
        assert len(finished) == 2
        memory = fetched_views(store, house, [*finished, "0_9_9"], lambda: True)
        assert {key.split("/")[3] for key in memory.list()} == set(finished)
        shutil.rmtree(out / "houses" / house / "done")
        assert planned_rows(store, home, want, lambda: True) == []
