import hashlib
import io
import json
import re
import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from PIL import Image

import pbrs_farm
from pbrs_farm.cli import main
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.house_split import SplitShares, split_of_house
from pbrs_farm.images import decode_photo
from pbrs_farm.store.folder import FolderStore
from pbrs_farm.views.packing.pack_shards import pack
from pbrs_farm.views.packing.packing_plan import Packing
from pbrs_farm.views.shard_parts import arrays_of_part
from pbrs_farm.views.view_sample import LAYERS, SampleRequest
from tests.scene.homes import small_home
from tests.views.small_roots import MODES, arrays_of_view, fill

HOUSES = {f"home-{k}-00000000": 3 for k in range(8)}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("root")
    fill(FolderStore(root), HOUSES)
    return root


def test_equal_views_give_equal_bytes(root, tmp_path):
    for name in "ab":
        pack(
            pbrs_farm.open(root),
            tmp_path / name,
            Packing((8, 6), modes=MODES, shares=SplitShares(), views_per_shard=5),
        )
    names = sorted(p.name for p in (tmp_path / "a").iterdir())
    assert names == sorted(p.name for p in (tmp_path / "b").iterdir())
    assert all(
        (tmp_path / "a" / n).read_bytes() == (tmp_path / "b" / n).read_bytes() for n in names
    )


def test_shards_are_split_by_house_and_mixed(root, tmp_path):
    shares = SplitShares(0.5, 0.25, 0.25)
    packing = Packing(modes=MODES, shares=shares, views_per_shard=4)
    packed = pack(pbrs_farm.open(root), tmp_path / "x", packing)
    assert sum(packed.n_views.values()) == 24
    views = pbrs_farm.open(tmp_path / "x")
    for split, n in packed.n_views.items():
        part = views.only(split=split)
        assert len(part) == n
        assert all(split_of_house(home, shares) == split for home in part.homes)
    first = json.loads((tmp_path / "x/dataset.json").read_text())["shards"][0]
    houses = {v.house for v in _facts(tmp_path / "x" / first["file"])}
    assert len(houses) > 1
    with pytest.raises(BadInput, match="no view in split"):
        pbrs_farm.open(tmp_path / "x").only(split="train", shares=SplitShares(0, 1, 0))


def _facts(shard: Path):
    from types import SimpleNamespace

    with tarfile.open(shard) as tar:
        for member in tar:
            if member.name.endswith(".json"):
                yield SimpleNamespace(**json.load(tar.extractfile(member)))


def test_other_programs_read_the_parts(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "x", Packing(modes=MODES))
    with tarfile.open(tmp_path / "x/all-000000.tar") as tar:
        data = {m.name: tar.extractfile(m).read() for m in tar}
    stored, key = arrays_of_view(1001), "home-1-00000000__0_0_1"
    arrays = np.load(io.BytesIO(data[f"{key}.normal.npz"]))
    assert arrays["normal"].dtype == np.uint16
    assert (arrays["normal"] == stored["normal.png"]).all()
    assert (decode_photo(data[f"{key}.mlt_il_ol.png"], "x") == stored["mlt_il_ol.png"]).all()
    assert (np.load(io.BytesIO(data[f"{key}.depth.npz"]))["depth"] == stored["depth.png"]).all()


def test_dataset_json_and_card_describe_the_views(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "x", Packing((8, 6), modes=MODES, shares=SplitShares()))
    description = json.loads((tmp_path / "x/dataset.json").read_text())
    assert description["classes"][1] == "wall"
    assert len(description["class_colours_srgb"]) == 41
    assert description["arrays"]["depth"]["unit"].startswith("mm")
    assert description["size"] == [8, 6]
    assert description["credits"] == [f"home {home}: a person" for home in HOUSES]
    card = (tmp_path / "x/README.md").read_text()
    assert "24 views, 8 homes or variants of homes, 8x6" in card
    assert "home home-3-00000000: a person" in card


def test_colour_may_be_packed_as_jpeg(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "x", Packing(modes=MODES, colour="jpeg"))
    sample = pbrs_farm.open(tmp_path / "x")[0].sample()
    assert sample.colour.shape == arrays_of_view(0)["mlt_il_ol.png"].shape
    assert (sample.normal[sample.valid] != 0).any()


def test_a_jpeg_part_is_decoded_by_pillow_and_a_damaged_one_is_an_error():
    picture = np.random.default_rng(0).integers(0, 256, (24, 32, 3)).astype(np.uint8)
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "JPEG", quality=90)
    (colour,) = arrays_of_part(["colour"], "mlt_il_ol.jpg", file.getvalue(), "x").values()
    assert (colour == np.asarray(Image.open(file))).all()
    for damaged in (b"", b"no picture", file.getvalue()[:300]):
        with pytest.raises(BadInput, match="shard 3: cannot be read as a JPEG"):
            arrays_of_part(["colour"], "mlt_il_ol.jpg", damaged, "shard 3")


def test_parquet_has_image_columns_and_every_bit_of_labels(root, tmp_path):
    packed = pack(
        pbrs_farm.open(root),
        tmp_path / "x",
        Packing(modes=MODES, shares=SplitShares()),
        form="parquet",
    )
    files = sorted((tmp_path / "x/data").iterdir())
    assert packed.n_files == len(files) + 2  # the card and croissant.json
    table = pq.read_table(files[-1])
    features = json.loads(table.schema.metadata[b"huggingface"])["info"]["features"]
    assert features["mlt_il_ol"] == {"_type": "Image"}
    assert features["house"] == {"dtype": "string", "_type": "Value"}
    assert features["depth"] == {"shape": [12, 16], "dtype": "uint16", "_type": "Array2D"}
    assert features["normal"] == {"shape": [12, 16, 3], "dtype": "uint16", "_type": "Array3D"}
    assert table.schema.field("depth").type == pa.list_(pa.list_(pa.uint16()))
    row = table.to_pylist()[0]
    number, view = int(row["house"].split("-")[1]), int(row["id"].rpartition("_")[2])
    stored = arrays_of_view(1000 * number + view)
    for name in ("normal", "depth", "instance"):
        assert np.array_equal(row[name], stored[f"{name}.png"])
    assert (decode_photo(row["mlt_il_ol"]["bytes"], "x") == stored["mlt_il_ol.png"]).all()
    assert json.loads(row["camera"])["width_px"] == 16
    assert "data/train-*.parquet" in (tmp_path / "x/README.md").read_text()


def test_views_of_two_sizes_are_no_table_of_arrays(tmp_path):
    store = FolderStore(tmp_path / "root")
    fill(store, {"home-0-00000000": 1})
    fill(store, {"home-1-00000000": 1}, size=(8, 6))
    views = pbrs_farm.open(tmp_path / "root")
    with pytest.raises(BadInput, match=r"views of (16x12 and 8x6|8x6 and 16x12) cannot be rows"):
        pack(views, tmp_path / "x", Packing(modes=MODES), form="parquet")
    assert not (tmp_path / "x").exists()
    pack(views, tmp_path / "x", Packing((8, 6), modes=MODES), form="parquet")


def test_parquet_that_is_not_split_is_a_split_that_datasets_takes(root, tmp_path):
    packed = pack(pbrs_farm.open(root), tmp_path / "x", Packing(modes=MODES), form="parquet")
    assert packed.n_views == {"train": 24}
    assert [p.name for p in (tmp_path / "x/data").iterdir()] == ["train-00000-of-00001.parquet"]
    card = (tmp_path / "x/README.md").read_text()
    assert "split: train" in card
    assert "all-" not in card
    description = json.loads((tmp_path / "x/croissant.json").read_text())
    (file, _files) = description["distribution"]
    data = (tmp_path / "x" / file["contentUrl"]).read_bytes()
    assert file["sha256"] == hashlib.sha256(data).hexdigest()


@pytest.mark.long
def test_the_card_is_true_of_the_root(tmp_path):
    home = small_home().set(**{"light.spp": 3})
    frames = pbrs_farm.render(home, home.cameras(n=2), modes=["mlt_il_ol"])
    frames.save(tmp_path / "root")
    packing = Packing((32, 24), modes=("mlt_il_ol",), seed=5, colour="jpeg")
    pack(pbrs_farm.open(tmp_path / "root"), tmp_path / "x", packing, form="parquet")
    card = (tmp_path / "x/README.md").read_text()
    for text in (
        f"| {home.id} | 2 | Apache-2.0 | pbrs_farm |",
        "Rendered at 64x48; horizontal field of view",
        "preset photo, lens pinhole",
        home.recipe.digest(),
        "integrator path, 3 samples a pixel",
        f"Seeds: {home.recipe.seed} of the recipe, 5 of the order of views.",
        "| wall | ",
        "the nearest pixel's at 32x24",
        "JPEG of quality 95",
        "It is not split.",
    ):
        assert text in card, text
    shares = re.findall(r"\| ([\d.]+) % \|", card)
    assert sum(map(float, shares)) == pytest.approx(100, abs=0.5)


def test_a_root_without_a_recipe_or_licences_is_refused(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "x", Packing(modes=MODES))
    card = (tmp_path / "x/README.md").read_text()
    assert "has no recipe.json" in card
    assert "Homes whose source names no licence: 8." in card


def test_a_truncated_or_missing_shard_is_reported_in_one_line(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "x", Packing(modes=MODES, views_per_shard=10))
    shard = tmp_path / "x/all-000001.tar"
    whole = shard.read_bytes()
    shard.write_bytes(whole[:5000])
    with pytest.raises(BadInput, match=rf"all-000001.tar: 5000 of {len(whole)} bytes: truncated"):
        pbrs_farm.open(tmp_path / "x")
    shard.write_bytes(whole[:5000] + b"?" * (len(whole) - 5000))
    with pytest.raises(BadInput, match=r"all-000001.tar: .*damaged"):
        pbrs_farm.open(tmp_path / "x")
    shard.unlink()
    with pytest.raises(BadInput, match=r"all-000001.tar: no such shard"):
        pbrs_farm.open(tmp_path / "x")


def test_skipped_views_are_reported(root, tmp_path):
    pack(
        pbrs_farm.open(root),
        tmp_path / "x",
        Packing(layers=("colour", "normal"), modes=("mlt_il_ol",)),
    )
    view = pbrs_farm.open(tmp_path / "x")[0]
    with pytest.raises(
        BadInput, match=r"no layer depth in these shards \(packed: colour, normal\)"
    ):
        view.sample(SampleRequest(("depth",)))
    with pytest.raises(BadInput, match=r"no pictures of the mode opengl_dl"):
        view.sample(SampleRequest(("colour",), "opengl_dl"))
    with pytest.raises(BadInput, match="is packed already"):
        pack(pbrs_farm.open(tmp_path / "x"), tmp_path / "y", Packing())


def test_the_verb_packs_and_lists_skipped_views(tmp_path, capsys):
    root, out = tmp_path / "root", tmp_path / "out"
    fill(FolderStore(root), {"one-00000001": 3})
    (root / "houses/one-00000001/views/0_0_2/mlt_il_ol.png").unlink()
    words = ["pack", str(root), "--size", "8x6", "--split", "--out", str(out)]
    assert main(words) == 0
    output = capsys.readouterr()
    assert "1 view left out, one-00000001/0_0_2: no mlt_il_ol.png" in output.err
    assert "2 views, 3 files" in output.out
    assert "lack a layer: 1." in (out / "README.md").read_text()
    assert main(words) == 1
    assert "already exists" in capsys.readouterr().err
    for wrong in (["--size", "8"], ["--split", "1/2"], ["--layers", "x"], ["--colour", "bmp"]):
        assert main(["pack", str(root), "--out", str(tmp_path / "y"), *wrong]) == 1
    assert not (tmp_path / "y").exists()


def test_shards_are_read_with_only_numpy(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "x", Packing((8, 6), modes=MODES, shares=SplitShares()))
    code = f"""
import sys
for name in ("pydantic", "OpenImageIO", "torch", "scipy", "pyarrow", "PIL", "obstore", "mitsuba"):
    sys.modules[name] = None
import pbrs_farm
from pbrs_farm.views.shard_parts import arrays_of_part
from pbrs_farm.views.view_sample import LAYERS, SampleRequest
views = pbrs_farm.open({str(tmp_path / "x")!r})
print(len(views), views[0].sample(SampleRequest(LAYERS)).normal.shape)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.stdout.split(maxsplit=1) == ["24", "(6, 8, 3)\n"]


def test_all_layers_are_packed_and_no_radiance(root, tmp_path):
    pack(pbrs_farm.open(root), tmp_path / "x", Packing(layers=LAYERS, modes=MODES))
    with tarfile.open(tmp_path / "x/all-000000.tar") as tar:
        parts = {name.partition(".")[2] for name in tar.getnames()}
    assert parts == {
        "json", "opengl_dl.png", "mlt_il_ol.png", "normal.npz", "depth.npz", "class40.png",
        "instance.npz", "boundary.png",
    }  # fmt: skip
