import json
import pickle
from pathlib import Path

import numpy as np
import obstore
import obstore.store
import pytest

import pbrs_farm
from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import png_from_array
from pbrs_farm.store import MemoryStore
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.store.s3 import S3Settings, S3Store
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.view_sample import LAYERS, SampleRequest
from tests.check.roots import make_root
from tests.views.small_roots import MODES, SIZE, arrays_of_view, fill, remove

HOUSES = {"one-00000001": 3, "two-00000002-d4": 2}
VIEW = "houses/one-00000001/views/0_0_1"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    fill(FolderStore(tmp_path / "root"), HOUSES)
    return tmp_path / "root"


def test_a_sample_equals_its_files(root):
    sample = pbrs_farm.open(root)[1].sample(SampleRequest(LAYERS, "opengl_dl", axes="published"))
    stored = arrays_of_view(1)
    assert (sample.id, sample.house, sample.room) == ("one-00000001/0_0_1", "one-00000001", "0_0")
    assert (sample.colour == stored["opengl_dl.png"]).all()
    assert (sample.class40 == stored["semantic.png"]).all()
    assert (sample.instance == stored["instance.png"]).all()
    assert (sample.boundary == (stored["boundary.png"] > 0)).all()
    assert sample.depth == pytest.approx(stored["depth.png"] / 1000)
    assert (sample.valid == (stored["valid.png"] > 0)).all()
    stored_again = np.rint((sample.normal.astype(np.float64) + 1) * 65535 / 2)
    assert (stored_again == stored["normal.png"]).all()
    assert sample.size == SIZE


def test_only_requested_layers_are_read(root):
    remove(root, f"{VIEW}/depth.png")
    (root / VIEW / "instance.png").write_bytes(b"damaged")
    sample = pbrs_farm.open(root)[1].sample(SampleRequest(("colour",)))
    assert set(sample.arrays()) == {"colour"}


def equal(a, b) -> bool:
    named = zip(a.arrays().items(), b.arrays().items(), strict=True)
    same = all(n == m and x.dtype == y.dtype and (x == y).all() for (n, x), (m, y) in named)
    facts = ("id", "house", "room", "mode", "axes")
    return same and (a.K == b.K).all() and all(getattr(a, f) == getattr(b, f) for f in facts)


@pytest.mark.parametrize("size", [None, (8, 6), (5, 4), (16, 6)])
def test_samples_have_the_same_bits_from_folder_memory_and_shards(root, tmp_path, size):
    memory = MemoryStore()
    fill(memory, HOUSES)
    request = SampleRequest(LAYERS, "mlt_il_ol", axes="opengl", size=size)
    places = [pbrs_farm.open(root), pbrs_farm.open(memory)]
    for packed_size, name in ((size, "small"), (None, "large")):
        pack(
            pbrs_farm.open(root),
            tmp_path / name,
            Packing(packed_size, modes=MODES, views_per_shard=2),
        )
        places.append(pbrs_farm.open(tmp_path / name))
    copied = MemoryStore()
    for file in (tmp_path / "small").iterdir():
        copied.put(file.name, file.read_bytes())
    places.append(pbrs_farm.open(copied))
    for views in zip(*places, strict=True):
        first, *rest = (view.sample(request) for view in views)
        assert all(equal(first, sample) for sample in rest)
        assert (views[0].k == views[1].k).all()


def test_a_manifest_names_the_views_if_listing_is_slow():
    store = MemoryStore()
    fill(store, HOUSES)
    rows = [{"key": key} for key in store.list("houses/one-00000001/")]
    store.put("manifest.jsonl", b"".join(json.dumps(row).encode() + b"\n" for row in rows))
    assert len(pbrs_farm.open(store)) == 3
    store.put("manifest.jsonl", b"{")
    with pytest.raises(BadInput, match="not a manifest"):
        pbrs_farm.open(store)


def test_views_are_chosen_by_house_split_and_object(root):
    fill(FolderStore(root), {"three-00000003": 1})
    (root / "objects").mkdir()
    (root / "houses/three-00000003").rename(root / "objects/object_three-00000003")
    views = pbrs_farm.open(root)
    assert views.homes == ("one-00000001", "two-00000002-d4", "object_three-00000003")
    assert len(views.only(objects=True)) == 1
    assert views.only(houses={"two-00000002-d4"}).homes == ("two-00000002-d4",)
    assert views.modes == ("opengl_dl", "mlt_il_ol")
    splits = {s: {v.ref.house for v in _only(views, s)} for s in ("train", "val", "test")}
    assert sum(map(len, splits.values())) == 3
    assert [view.id for view in views[1:3]] == [views[1].id, views[2].id]


def _only(views, split):
    try:
        return views.only(split=split)
    except BadInput:
        return ()


def test_views_that_a_run_has_not_finished_are_left_out_and_named(root):
    remove(root, f"{VIEW}/view.json")
    remove(root, "houses/one-00000001/views/0_0_2/mlt_il_ol.png")
    views = pbrs_farm.open(root)
    assert len(views) == 4
    assert views.left_out == {"one-00000001/0_0_1": "no view.json"}
    asked = views.only(request=SampleRequest(("colour",), "mlt_il_ol"))
    assert len(asked) == 3
    assert asked.left_out == {"one-00000001/0_0_2": "no mlt_il_ol.png"}
    with pytest.raises(
        BadInput, match=r"none of 4 views has the requested layers: .* no mlt_ol.png"
    ):
        views.only(request=SampleRequest(("colour",), "mlt_ol"))


def test_16_bit_labels_that_arrive_as_8_bits_are_an_error(root):
    stored = arrays_of_view(1)["normal.png"]
    file = root / VIEW / "normal.png"
    file.write_bytes(png_from_array((stored >> 8).astype(np.uint8)))
    view = pbrs_farm.open(root)[1]
    with pytest.raises(BadInput, match=r"normal.png: 8 bits a value, 16 are stored"):
        view.sample()
    file.write_bytes(png_from_array((stored >> 8) * np.uint16(257)))
    with pytest.raises(BadInput, match="8 bits spread over 16"):
        view.sample()
    assert view.sample(SampleRequest(("colour", "class40"))).colour is not None


def test_a_damaged_file_and_one_of_another_size_are_named(root):
    view = pbrs_farm.open(root)[1]
    (root / VIEW / "mlt_il_ol.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(BadInput, match=r"mlt_il_ol.png"):
        view.sample()
    (root / VIEW / "depth.png").write_bytes(png_from_array(np.ones((3, 3), np.uint16)))
    with pytest.raises(BadInput, match=r"depth.png: uint16 \(3, 3\), expected uint16 \(12, 16\)"):
        view.sample(SampleRequest(("depth",)))
    (root / VIEW / "view.json").write_text("{")
    with pytest.raises(BadInput, match=r"view.json: not JSON"):
        pbrs_farm.open(root)[1].sample(SampleRequest(("class40",)))
    (root / VIEW / "view.json").write_text("{}")
    with pytest.raises(BadInput, match=r"view.json: not a view's camera"):
        pbrs_farm.open(root)[1].sample(SampleRequest(("class40",)))


def test_a_folder_that_is_no_root_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no such folder"):
        pbrs_farm.open(tmp_path / "nowhere")
    with pytest.raises(BadInput, match="no finished view"):
        pbrs_farm.open(tmp_path)
    (tmp_path / "dataset.json").write_text('{"form": "another"}')
    with pytest.raises(BadInput, match=r"dataset.json: form: 'another', expected"):
        pbrs_farm.open(tmp_path)


@pytest.mark.parametrize(
    ("fields", "match"),
    [
        ({"layers": ("colours",)}, "no such layer"),
        ({"mode": "mlt"}, "no such lighting mode"),
        ({"axes": "blender"}, "no such axes"),
        ({"size": (0, 3)}, "expected a width"),
    ],
)
def test_an_impossible_request_is_refused(fields, match):
    with pytest.raises(BadInput, match=match):
        SampleRequest(**fields)


def test_views_can_be_sent_to_another_process(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "shards", Packing(modes=MODES))
    for place in (root, tmp_path / "shards"):
        views = pbrs_farm.open(place)
        views[0].sample()
        sent = pickle.loads(pickle.dumps(views))
        assert equal(sent[0].sample(), views[0].sample())


def s3_like() -> S3Store:
    """An S3 store whose client keeps its objects in memory."""
    store = S3Store("bucket", "some/prefix", S3Settings())
    store.client = obstore.store.MemoryStore()
    return store


def test_samples_have_the_same_bits_from_s3(root, tmp_path):
    request = SampleRequest(LAYERS, "mlt_il_ol", size=(8, 6))
    expected = [view.sample(request) for view in pbrs_farm.open(root)]
    bucket, shards = s3_like(), s3_like()
    fill(bucket, HOUSES)
    pack(pbrs_farm.open(bucket), tmp_path / "x", Packing((8, 6), modes=MODES))
    for file in (tmp_path / "x").iterdir():
        shards.put(file.name, file.read_bytes())
    for store in (bucket, shards):
        views = pbrs_farm.open(store)
        assert views.source.url == "s3://bucket/some/prefix"
        assert all(equal(a, view.sample(request)) for a, view in zip(expected, views, strict=True))


def test_an_s3_store_is_reopened_in_another_process():
    sent = pickle.loads(pickle.dumps(s3_like()))
    assert sent.url == "s3://bucket/some/prefix"
    assert isinstance(sent.client, obstore.store.S3Store)


def test_stored_layers_are_read_by_name(root):
    view = pbrs_farm.open(root)[1]
    assert view.layers == (
        "opengl_dl",
        "mlt_il_ol",
        "depth",
        "normal",
        "valid",
        "semantic",
        "instance",
        "boundary",
    )
    assert (view.layer("depth") == arrays_of_view(1)["depth.png"]).all()
    with pytest.raises(BadInput, match=r"0_0_1: no layer albedo \(of opengl_dl, "):
        view.layer("albedo")


def test_only_selected_views_are_read(root):
    rows = [{"house": "one-00000001", "view": f"0_0_{k}", "kept": k != 1} for k in range(3)]
    (root / "selection").mkdir()
    (root / "selection/run.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    views = pbrs_farm.open(root)
    assert [v.id for v in views.only(selection="run")] == [
        "one-00000001/0_0_0",
        "one-00000001/0_0_2",
    ]
    with pytest.raises(BadInput, match="no such selection"):
        views.only(selection="other")


def test_normals_of_a_floor_point_up_in_the_world(tmp_path):
    make_root(tmp_path)
    for axes, to_opencv in (("opencv", (1, 1, 1)), ("opengl", (1, -1, -1))):
        for view in pbrs_farm.open(tmp_path):
            sample = view.sample(SampleRequest(("normal", "class40"), axes=axes))
            floor = sample.normal[(sample.class40 == 2) & sample.valid] * np.array(to_opencv)
            world = floor @ view.world_from_camera_opencv[:3, :3].T
            assert len(world) > 100
            assert world == pytest.approx(np.broadcast_to([0, 1, 0], world.shape), abs=1e-4)
