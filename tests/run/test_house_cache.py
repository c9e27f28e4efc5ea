"""The house cached by a process: when it is read again."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest

from pbrs_farm.core import keys
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house import Texture
from pbrs_farm.core.recipe import recipe_from_name
from pbrs_farm.images import png_from_array
from pbrs_farm.prepare.source import resolve
from pbrs_farm.run.house_cache import DecodedOnDemand, HouseCache, decoded_textures
from pbrs_farm.run.step_cache import Work
from pbrs_farm.run.steps import run_step
from pbrs_farm.store import MemoryStore


class CountingStore(MemoryStore):
    """A store in memory that counts the reads of each object."""

    def __init__(self) -> None:
        super().__init__()
        self.n_reads: Counter[str] = Counter()

    def get(self, key: str) -> bytes:
        self.n_reads[key] += 1
        return super().get(key)


@pytest.fixture(scope="module")
def work() -> Work:
    fields = {"image.width_px": "32", "image.height_px": "24", "cameras.cell_m": "1.0"}
    fields |= {"cameras.score_width_px": "64", "cameras.score_height_px": "48"}
    source = resolve("builtin")
    work = Work(
        CountingStore(),
        recipe_from_name("preview", fields),
        source.house_id,
        HouseCache(),
        source=source,
    )
    run_step("house", work)
    return work


def view_work(work: Work, view: str) -> Work:
    return Work(
        work.store, work.recipe, work.house_id, work.house_cache, source=work.source, view_id=view
    )


def test_the_trees_of_the_camera_search_are_freed_after_it(work: Work) -> None:
    run_step("cameras", work)
    digest = run_step("house", work).marker.digest
    house = work.house_cache.get(work.store, work.recipe, work.house_id, digest)
    assert "geometry" in vars(house)
    assert "caster" not in vars(house)


def test_cameras_json_is_read_once_a_house_and_process(work: Work) -> None:
    views = [row[0] for row in run_step("cameras", work).marker.facts["views"]][:3]
    assert len(views) == 3
    for view in views:
        for step in ("truth", "view"):
            run_step(step, view_work(work, view))
    assert isinstance(work.store, CountingStore)
    assert work.store.n_reads[keys.house_key(work.house_id, "cameras.json")] == 1
    assert work.store.n_reads[keys.house_key(work.house_id, "house.glb")] == 1


def test_cameras_json_is_read_again_when_it_was_written_again(work: Work) -> None:
    marker = run_step("cameras", work).marker
    house = work.house_cache.get(
        work.store, work.recipe, work.house_id, run_step("house", work).marker.digest
    )
    view = marker.facts["views"][0][0]
    before = house.view(view, marker.digest)
    assert house.view(view, marker.digest) is before
    assert house.view(view, "another") is not before
    with pytest.raises(BadInput, match="no such view"):
        house.view("9_9_9", marker.digest)


def test_light_names_the_step_it_lacks(work: Work) -> None:
    view = run_step("cameras", work).marker.facts["views"][0][0]
    assert work.store.head(keys.marker_key(work.house_id, "illuminance")) is None
    with pytest.raises(BadInput, match="illuminance: is not done yet"):
        run_step("light", view_work(work, view))


def test_only_the_named_textures_are_decoded() -> None:
    png = png_from_array(np.zeros((2, 3, 3), np.uint8))
    textures = {
        name: Texture(name, name, "image/png", data)
        for name, data in (("a", png), ("b", b"no picture"), ("c", png))
    }
    house = SimpleNamespace(textures=textures)
    assert decoded_textures(house, {"a", "b"})[0].keys() == {"a"}  # type: ignore[arg-type]
    assert decoded_textures(house, {"a", "b"})[1] == ["b"]  # type: ignore[arg-type]
    assert decoded_textures(house)[0].keys() == {"a", "c"}  # type: ignore[arg-type]


def test_a_picture_is_decoded_by_its_look_up_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []
    monkeypatch.setattr(
        "pbrs_farm.images.decode_texture", lambda _data, name, _type: asked.append(name)
    )
    pictures = DecodedOnDemand({name: Texture(name, name, "image/png", b"") for name in "ab"})
    assert "a" in pictures
    assert list(pictures) == ["a", "b"]
    assert not asked
    _ = pictures["b"]
    assert asked == ["b"]
