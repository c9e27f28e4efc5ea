from __future__ import annotations

import json
import re
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.house import House
from pbrs_farm.core.recipe import ReadFields
from pbrs_farm.prepare.source import resolve
from pbrs_farm.read.suncg.suncg_house import read_suncg
from tests.hypothesis_profiles import examples
from tests.inputs.damaged_json import outcome, paths_of, values
from tests.read.suncg import suncg_root
from tests.read.suncg.suncg_root import HOUSE

JSON = f"house/{HOUSE}/house.json"


@pytest.fixture(scope="module")
def pristine(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pristine")
    suncg_root.write_root(folder)
    return folder


@pytest.fixture
def root(pristine: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(pristine, tmp_path / "root"))


def read(root: Path, **fields: Any) -> House:
    return read_suncg(root, HOUSE, ReadFields(**fields))


def node(k: int, **more: Any) -> Callable[[dict[str, Any]], None]:
    return lambda plain: plain["levels"][0]["nodes"][k].update(more)


@pytest.mark.parametrize(
    ("edit", "place"),
    [
        (lambda p: p.pop("levels"), "levels"),
        (lambda p: p.update(levels={"0": []}), "levels"),
        (lambda p: p.update(levels=[3]), "level 0"),
        (lambda p: p["levels"][0].pop("nodes"), "level 0, nodes"),
        (lambda p: p["levels"][0]["nodes"].insert(3, "node"), "level 0 node 3"),
        (lambda p: p["levels"].append(p["levels"][0]), "level 3"),
        (lambda p: p.update(scaleToMeters=0), "scaleToMeters"),
        (lambda p: p.update(scaleToMeters="1"), "scaleToMeters"),
        (lambda p: p.update(up=[0, 0, 0]), "up, front"),
        (lambda p: p.update(up=[0, 0, 1]), "up, front"),
        (lambda p: p.update(front=[0, 1]), "front"),
        (node(2, transform=[1] * 15), "level 0 node 2 (Object 0_2), transform"),
        (node(2, transform=[1] * 16), "level 0 node 2 (Object 0_2), transform"),
        (node(2, transform=[0] * 15 + [1]), "level 0 node 2 (Object 0_2), transform"),
        (node(2, transform=["x"] * 16), "level 0 node 2 (Object 0_2), transform[0]"),
        (node(2, transform=[*suncg_root.placement(1, 0, 1)[:12], 10**30, 0, 0, 1]),
         "level 0 node 2 (Object 0_2), transform[12]"),
        (node(2, transform=suncg_root.placement(10_000, 0, 1)), "level 0 node 2 (Object 0_2)"),
        (node(2, modelId="../../etc/passwd"), "level 0 node 2 (Object 0_2), modelId"),
        (node(2, modelId=".."), "level 0 node 2 (Object 0_2), modelId"),
        (node(2, modelId=None), "level 0 node 2 (Object 0_2), modelId"),
        (node(2, modelId="a/b"), "level 0 node 2 (Object 0_2), modelId"),
        (node(0, modelId="../x"), "level 0 node 0 (Room 0_0), modelId"),
        (node(2, state="open"), "level 0 node 2 (Object 0_2), state"),
        (node(2, state=-1), "level 0 node 2 (Object 0_2), state"),
        (node(2, materials=["wood"]), "level 0 node 2 (Object 0_2), materials[0]"),
        (node(2, materials=[{"texture": "../x"}]),
         "level 0 node 2 (Object 0_2), materials[0].texture"),
        (node(2, materials=[{"diffuse": "red"}]),
         "level 0 node 2 (Object 0_2), materials[0].diffuse"),
        (node(11, dimensions=[1, 1]), "level 0 node 11 (Box 0_11), dimensions"),
        (node(11, dimensions=[1, 1, -1]), "level 0 node 11 (Box 0_11), dimensions[2]"),
        (node(0, nodeIndices=["a"]), "level 0 node 0 (Room 0_0), nodeIndices[0]"),
        (node(0, bbox={"min": [0], "max": [1]}), "level 0 node 0 (Room 0_0), bbox.min"),
    ],
)  # fmt: skip
def test_a_wrong_house_json_is_refused_naming_the_node(root: Path, edit: Any, place: str) -> None:
    plain = suncg_root.house_json()
    edit(plain)
    (root / JSON).write_text(json.dumps(plain))
    with pytest.raises(BadHouse) as caught:
        read(root)
    assert caught.value.place == place
    assert JSON in caught.value.file


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "null", '{"levels": NaN}', "[" * 50_000, '{"levels": [' * 2000, "\x00"]
)
def test_text_that_is_no_house_json_is_refused(root: Path, text: str) -> None:
    (root / JSON).write_text(text)
    with pytest.raises(BadHouse, match=r"house\.json"):
        read(root)


def test_of_a_million_wrong_entries_only_the_first_costs_anything(root: Path) -> None:
    plain = suncg_root.house_json()
    node(2, materials=["wood"] * 1_000_000)(plain)
    (root / JSON).write_text(json.dumps(plain))
    start = time.process_time()
    with pytest.raises(BadHouse, match=r"node 2 .*materials\[0\]: expected an object"):
        read(root)
    assert time.process_time() - start < 3


def test_house_json_cut_anywhere_is_refused(root: Path) -> None:
    whole = (root / JSON).read_bytes()
    for end in range(0, len(whole), 211):
        (root / JSON).write_bytes(whole[:end])
        with pytest.raises(BadHouse, match=r"house\.json"):
            read(root)


@pytest.mark.parametrize(
    "row", ["lamp 3 1", "lamp 1 bulb 0", "lamp 0 2 material_1", "lamp 1 -1 0", "lamp"]
)
def test_an_unreadable_row_of_lamps_costs_only_that_lamp(root: Path, row: str) -> None:
    (root / "metadata/light_geometry_compact.txt").write_text(f"other 1 material_0 0\n{row}\n")
    (note,) = [n for n in read(root).notes if n.kind == "unreadable-row"]
    assert "light_geometry_compact.txt: line 2" in str(note)
    assert "lamp: expected counts" in note.text


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("object/chair/chair.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "4 of 3 does not exist"),
        ("object/chair/chair.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n", "does not exist"),
        ("object/chair/chair.obj", "v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n", "not a finite"),
        ("object/chair/chair.obj", "v 0 0 0\nv 1 x 0\nv 0 1 0\nf 1 2 3\n", "not a number"),
        ("object/chair/chair.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf a b c\n", "not an index"),
        ("metadata/suncgModelLights.json", '{"lamp": [{"type": "Sun"}]}', r"lamp\[0\]"),
        ("metadata/suncgModelLights.json", '{"lamp": [{"type": "PointLight", "power": 3}]}', "position"),
        ("metadata/suncgModelLights.json", '{"lamp": [{"type": []}]}', r"lamp\[0\]"),
        ("metadata/suncgModelLights.json", "{", "not valid JSON"),
    ],
)  # fmt: skip
def test_a_wrong_model_is_left_out_and_a_wrong_table_refused_naming_the_file(
    root: Path, name: str, text: str, message: str
) -> None:
    (root / name).write_text(text)
    if name.endswith(".obj"):
        # A library is shared: a damaged model is skipped with a note that names its file.
        notes = [n.text for n in read(root).notes if n.kind == "unreadable-model"]
        assert any(name in text and re.search(message, text) for text in notes)
        return
    with pytest.raises(BadHouse, match=message) as caught:
        read(root)
    assert caught.value.file == name


def test_empty_models_are_left_out_with_a_note(root: Path) -> None:
    (root / "object/chair/chair.obj").write_text("v 0 0 0\n")
    house = read(root)
    assert any(n.kind == "empty-model" for n in house.notes)
    assert not any(i.source_class == "chair" for i in house.items)


def test_a_model_with_too_many_triangles_is_refused_before_it_is_parsed(root: Path) -> None:
    corner = b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    (root / "object/chair/chair.obj").write_bytes(corner + b"f 1 2 3\n" * 10_000_000)
    start = time.monotonic()
    with pytest.raises(BadHouse, match=r"chair\.obj.*at most.*max_model_triangles"):
        read(root, max_model_triangles=500_000)
    assert time.monotonic() - start < 5
    (root / "object/chair/chair.obj").write_bytes(corner + b"f 1 2 3\n" * 1001)
    with pytest.raises(BadHouse, match="at most 1000"):
        read(root, max_model_triangles=1000)


def test_a_house_with_too_many_triangles_is_refused(root: Path) -> None:
    with pytest.raises(BadHouse, match="more than 100 triangles"):
        read(root, max_triangles=100)


def test_textures_of_models_that_lead_out_are_refused(root: Path) -> None:
    mtl = root / "object/chair/chair.mtl"
    mtl.write_text(mtl.read_text().replace("../../texture//wood.jpg", "../../../secret.jpg"))
    with pytest.raises(BadHouse, match="leads out of the folder"):
        read(root)


@pytest.mark.parametrize("name", ["texture/wood.jpg", "object/chair/chair.obj", JSON])
def test_links_that_lead_out_are_refused(root: Path, tmp_path: Path, name: str) -> None:
    outside = tmp_path / "outside"
    (root / name).rename(outside)
    (root / name).symlink_to(outside)
    with pytest.raises(BadHouse, match="link that leads out"):
        read(root)


def test_links_inside_the_root_are_followed(root: Path) -> None:
    (root / "texture/wood.jpg").rename(root / "texture/real.jpg")
    (root / "texture/wood.jpg").symlink_to(root / "texture/real.jpg")
    assert not any("wood" in n.text for n in read(root).notes)


def test_a_root_without_rooms_names_the_missing_archive(root: Path) -> None:
    shutil.rmtree(root / "room")
    with pytest.raises(BadHouse, match=r"room/ does not exist.*room\.zip"):
        read(root)


def test_a_house_without_its_rooms_is_refused(root: Path) -> None:
    shutil.rmtree(root / f"room/{HOUSE}")
    (root / "room/other").mkdir()
    with pytest.raises(BadHouse, match=f"room/{HOUSE} does not exist"):
        read(root)


def test_a_house_without_any_room_is_refused(root: Path) -> None:
    plain = suncg_root.house_json()
    plain["levels"][0]["nodes"] = plain["levels"][0]["nodes"][2:9]
    (root / JSON).write_text(json.dumps(plain))
    with pytest.raises(BadHouse, match="no room"):
        read(root)


@pytest.mark.parametrize("house_id", ["", "..", "../x", "a/b", "x" * 65, "\0"])
def test_ids_that_are_no_names_are_refused(root: Path, house_id: str) -> None:
    with pytest.raises(BadHouse, match="not a house id"):
        read_suncg(root, house_id, ReadFields())


def test_a_house_outside_a_root_is_refused_with_the_layout_of_a_root(
    root: Path, tmp_path: Path
) -> None:
    alone = tmp_path / "homes" / HOUSE
    shutil.copytree(root / "house" / HOUSE, alone)
    shutil.copy(alone / "house.json", tmp_path / "house_p.json")
    (tmp_path / "only").mkdir()
    shutil.copy(alone / "house.json", tmp_path / "only/house_p.json")
    for word in (alone, alone / "house.json", tmp_path / "house_p.json", tmp_path / "only"):
        with pytest.raises(BadHouse, match=r"ROOT/house/ID/house\.json beside ROOT/room"):
            resolve(str(word))


def test_a_house_that_is_not_there_is_refused(root: Path) -> None:
    with pytest.raises(BadHouse, match="does not exist"):
        read_suncg(root, "nothing", ReadFields())


def test_equal_ids_are_made_different_and_noted(root: Path) -> None:
    plain = suncg_root.house_json()
    plain["levels"][0]["nodes"][3]["id"] = "0_2"
    (root / JSON).write_text(json.dumps(plain))
    house = read(root)
    ids = [i.id for i in house.items]
    assert len(set(ids)) == len(ids)
    assert any(n.kind == "duplicate-id" for n in house.notes)


def test_unknown_materials_are_grey_with_a_note(root: Path) -> None:
    obj = root / "object/chair/chair.obj"
    obj.write_text(obj.read_text().replace("material_1", "brass"))
    house = read(root)
    assert any(n.kind == "unknown-material" and "brass" in n.text for n in house.notes)
    chair = next(i for i in house.items if i.id == "0_2")
    assert house.materials[chair.surfaces[1].material].diffuse == (0.8, 0.8, 0.8)


def test_a_model_without_mtl_is_grey_with_a_note(root: Path) -> None:
    (root / "object/chair/chair.mtl").unlink()
    house = read(root)
    assert any(n.kind == "missing-materials" for n in house.notes)
    assert any(i.source_class == "chair" for i in house.items)


FILES = [
    JSON,
    "object/chair/chair.obj",
    "object/lamp/lamp.mtl",
    f"room/{HOUSE}/fr_0rm_0w.obj",
    f"room/{HOUSE}/fr_0rm_0f.mtl",
    "metadata/ModelCategoryMappingNewActive.csv",
    "metadata/suncgModelLights.json",
    "metadata/light_geometry_compact.txt",
    "metadata/models.csv",
    "texture/wood.jpg",
]

edits = st.lists(
    st.tuples(
        st.sampled_from(FILES),
        st.integers(0, 10**6),
        st.one_of(
            st.binary(max_size=4),
            st.sampled_from([b"nan", b"-1", b"1e400", b"\n", b"]", b'"', b"null", b"999999999"]),
        ),
        st.integers(0, 12),
    ),
    min_size=1,
    max_size=4,
)


@settings(max_examples=examples(30), deadline=20_000, suppress_health_check=list(HealthCheck))
@given(edits)
def test_whatever_the_bytes_the_outcome_is_a_house_or_a_bad_house(
    pristine: Path, changes: list[tuple[str, int, bytes, int]]
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        root = Path(shutil.copytree(pristine, Path(folder) / "root"))
        for name, start, new, n_gone in changes:
            data = (root / name).read_bytes()
            start %= len(data) + 1
            (root / name).write_bytes(data[:start] + new + data[start + n_gone :])
        outcome(lambda: read(root))


PATHS = paths_of(suncg_root.house_json())


@settings(max_examples=examples(30), deadline=20_000, suppress_health_check=list(HealthCheck))
@given(st.sampled_from(PATHS), values)
def test_any_value_anywhere_in_house_json_gives_a_house_or_a_bad_house(
    pristine: Path, path: tuple[Any, ...], value: Any
) -> None:
    plain = suncg_root.house_json()
    holder: Any = plain
    for key in path[:-1]:
        holder = holder[key]
    holder[path[-1]] = value
    with tempfile.TemporaryDirectory() as folder:
        for name in ("room", "object", "texture", "metadata"):
            shutil.copytree(pristine / name, Path(folder) / name)
        suncg_root.write(Path(folder) / JSON, json.dumps(plain))
        file = outcome(lambda: read(Path(folder)))
        assert not file or file.endswith(JSON) or file == folder
