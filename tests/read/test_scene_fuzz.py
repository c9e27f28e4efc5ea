"""Hypothesis on the bytes of glTF scenes and bundles."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.formats import glb
from pbrs_farm.formats.house_bundle import bundle_from_house, house_from_bundle
from pbrs_farm.read.gltf.scene import read_gltf
from tests.hypothesis_profiles import examples
from tests.inputs.damaged_json import outcome, paths_of, values
from tests.read.gltf.gltf_scenes import two_rooms
from tests.read.small_houses import full_house

SCENE = two_rooms()
SCENE.node("Lamp", mesh=SCENE.box([1, 0, 1], [1.2, 1, 1.2]), extras={"class": "lamp"})
SCENE.node("Door", mesh=SCENE.box([3.9, 0, 1], [4.1, 2, 2]), scale=[1, 1, 1], rotation=[0, 0, 0, 1])
BYTES = SCENE.glb()
DOCUMENT = glb.gltf_from_glb(BYTES, "x").document
BINARY = glb.gltf_from_glb(BYTES, "x").buffers[0]
BUNDLE = bundle_from_house(full_house())


@settings(max_examples=examples(150), deadline=10_000, suppress_health_check=list(HealthCheck))
@given(
    st.lists(
        st.tuples(st.integers(0, 10**7), st.binary(max_size=5), st.integers(0, 9)),
        min_size=1,
        max_size=4,
    )
)
@example(changes=[(192242, b"\x00\x00\x9fN", 0)])  # GEOS divides by zero where a floor grows
def test_whatever_the_bytes_of_a_glb_the_outcome_is_a_house_or_a_bad_house(
    changes: list[tuple[int, bytes, int]],
) -> None:
    data = BYTES
    for start, new, n_gone in changes:
        start %= len(data) + 1
        data = data[:start] + new + data[start + n_gone :]
    file = outcome(lambda: read_gltf(data, "scene.glb", fields=ReadFields()))
    assert file in ("", "scene.glb")


@settings(max_examples=examples(200), deadline=10_000, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(paths_of(DOCUMENT)), values)
def test_any_value_anywhere_in_a_scene_gives_a_house_or_a_bad_house(
    path: tuple[Any, ...], value: Any
) -> None:
    document = json.loads(json.dumps(DOCUMENT))
    holder = document
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    writer = glb.GlbWriter()
    writer.add_bytes(BINARY)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = BYTES[12 + 8 + int.from_bytes(BYTES[12:16], "little") :]
    chunk = len(text).to_bytes(4, "little") + b"JSON" + text
    head = b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunk) + len(rest)).to_bytes(4, "little")
    data = head + chunk + rest
    file = outcome(lambda: read_gltf(data, "scene.glb", fields=ReadFields()))
    assert file in ("", "scene.glb")


@settings(max_examples=examples(150), deadline=10_000, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(paths_of(json.loads(BUNDLE[1]))), values)
def test_any_value_anywhere_in_house_json_gives_a_house_or_a_bad_house(
    path: tuple[Any, ...], value: Any
) -> None:
    plain = json.loads(BUNDLE[1])
    holder = plain
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    file = outcome(lambda: house_from_bundle(BUNDLE[0], json.dumps(plain).encode()))
    assert file in ("", "house.json", "house.glb")


@settings(max_examples=examples(100), deadline=10_000)
@given(st.binary(max_size=400))
def test_random_bytes_are_refused(data: bytes) -> None:
    for json_bytes, arrays in ((data, BUNDLE[1]), (BUNDLE[0], data)):
        with pytest.raises(BadHouse):
            house_from_bundle(json_bytes, arrays)
    with pytest.raises(BadHouse):
        read_gltf(data, "scene.glb", fields=ReadFields())
