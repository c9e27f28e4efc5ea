"""Kinds of falsehood in a set, each planted in a finished one: the change, and the check that must find it.

Effects: a plant changes files of the given folder; `planted` makes SHA256SUMS and markers agree afterwards, unless
the kind is one of UNSIGNED.
"""

from __future__ import annotations

import hashlib
import io
import json
import shutil
import tarfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

from pbrs_farm.check.certificate import Tally
from pbrs_farm.check.stored_set import stored_set
from pbrs_farm.check.verify import check_set
from pbrs_farm.images import array_from_png, png_from_array
from pbrs_farm.views.shard_parts import npz_of_arrays
from pbrs_farm.views.shard_tar import write_samples
from tests.check.falsehoods import edit_json

FORMS = """
[form.yolo]
parts = ["views"]
[form.yolo-depth]
parts = ["views"]
[form.yolo-seg]
parts = ["views"]
[form.yolo-semantic]
parts = ["views"]
[form.marigold]
parts = ["views"]
[form.questions]
parts = ["views"]
[form.nerfstudio]
parts = ["views"]
[form.wai]
parts = ["views"]
[form.moge]
parts = ["views"]
[form.openspatial]
parts = ["views"]
[form.hdf5]
parts = ["views"]
[form.parquet]
size = "32x24"
parts = ["views"]
[form.half]
to = "coco"
size = "32x24"
parts = ["views"]
"""
"""Tables of a set's file, beside those of small_set."""

Plant = Callable[[Path], object]


def _one(out: Path, pattern: str) -> Path:
    return min(out.glob(pattern))


def _json(pattern: str, change: Callable[[Any], object]) -> Plant:
    return lambda out: edit_json(_one(out, pattern), change)


def _text(pattern: str, old: str, new: str) -> Plant:
    def plant(out: Path) -> None:
        file = _one(out, pattern)
        text = file.read_text()
        assert old in text, f"{file} lacks {old}"
        file.write_text(text.replace(old, new, 1))

    return plant


def _png(pattern: str, change: Callable[[Any], Any]) -> Plant:
    def plant(out: Path) -> None:
        file = _one(out, pattern)
        array = array_from_png(file.read_bytes())
        file.write_bytes(png_from_array(np.ascontiguousarray(change(array), array.dtype)))

    return plant


def _swap(pattern: str) -> Plant:
    """Exchange the first and the last file."""

    def plant(out: Path) -> None:
        files = sorted(out.glob(pattern))
        first = files[0].read_bytes()
        shutil.copy(files[-1], files[0])
        files[-1].write_bytes(first)

    return plant


def _shard(part: str, change: Callable[[bytes], bytes]) -> Plant:
    """Change a part of the first sample of the shards, and dataset.json with it."""

    def plant(out: Path) -> None:
        file = _one(out, "forms/shards/views/*.tar")
        samples: dict[str, dict[str, bytes]] = {}
        with tarfile.open(file) as tar:
            for member in tar:
                key, _, name = member.name.partition(".")
                samples.setdefault(key, {})[name] = tar.extractfile(member).read()  # type: ignore[union-attr]
        first = next(iter(samples.values()))
        first[part] = change(first[part])
        write_samples(file, samples.items())
        data = file.read_bytes()
        row = {"n_bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}
        document = json.loads((file.parent / "dataset.json").read_text())
        next(r for r in document["shards"] if r["file"] == file.name).update(row)
        (file.parent / "dataset.json").write_text(json.dumps(document))

    return plant


def _scaled_npz(data: bytes) -> bytes:
    arrays = dict(np.load(io.BytesIO(data)))
    return npz_of_arrays({"depth": (arrays["depth"] * 1.02).astype(np.uint16)})


def _other_k(data: bytes) -> bytes:
    row = json.loads(data)
    row["K"][0][0] *= 1.1
    return json.dumps(row).encode()


def _columns(change: Callable[[dict[str, Any]], object]) -> Plant:
    """Change the first row of the Parquet file."""

    def plant(out: Path) -> None:
        file = _one(out, "forms/parquet/views/data/*.parquet")
        table = pq.read_table(file)
        rows = table.to_pylist()
        change(rows[0])
        pq.write_table(pa.Table.from_pylist(rows, table.schema), file)

    return plant


def _nearer(row: dict[str, Any]) -> None:
    row["depth"][3] = [value * 2 for value in row["depth"][3]]


def _other_answer(out: Path) -> None:
    """A longer distance, in each file of the questions alike."""
    folder = _one(out, "forms/questions/views/*/questions.jsonl").parent
    rows = [json.loads(line) for line in (folder / "questions.jsonl").read_text().splitlines()]
    talks = [json.loads(line) for line in (folder / "conversations.jsonl").read_text().splitlines()]
    rows[0]["ground_truth"] = talks[0]["conversations"][1]["value"] = "250"
    for name, of in (("questions", rows), ("conversations", talks)):
        (folder / f"{name}.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in of))
    table = pq.read_table(folder / "questions.parquet")
    pq.write_table(pa.Table.from_pylist(rows, table.schema), folder / "questions.parquet")


def _other_phrase(out: Path) -> None:
    """A phrase of another noun for the last annotation."""
    folder = _one(out, "forms/questions/views/*/refs.json").parent
    document = json.loads((folder / "instances.json").read_text())
    row = document["annotations"][-1]
    names = {image["id"]: image["file_name"] for image in document["images"]}
    sentence = {"sent_id": 0, "sent": "the bed", "raw": "the bed", "tokens": ["the", "bed"]}
    ref = {
        "ref_id": 0, "ann_id": row["id"], "image_id": row["image_id"], "category_id": row["category_id"],
        "file_name": names[row["image_id"]], "sent_ids": [0], "sentences": [sentence],
    }  # fmt: skip
    (folder / "refs.json").write_text(json.dumps([ref]))


def _to_the_other_split(out: Path) -> None:
    """The files of a view in the folders of another split."""
    for file in out.glob("forms/yolo/views/val/*/*__0_0_5.*"):
        shutil.move(file, out / "forms/yolo/views/test" / file.relative_to(out).parts[4])


def _without_image(document: dict[str, Any]) -> None:
    image = document["images"].pop()
    rows = document["annotations"]
    document["annotations"] = [row for row in rows if row["image_id"] != image["id"]]


def _moved_box(document: dict[str, Any]) -> None:
    document["annotations"][0]["bbox"][0] += 5


def _moved_line(out: Path) -> None:
    file = next(f for f in sorted(out.glob("forms/yolo/views/*/labels/*.txt")) if f.read_text())
    number, x, *rest = file.read_text().split(" ")
    file.write_text(" ".join([number, f"{float(x) + 5 / 128:.6f}", *rest]))


def _moved_polygon(out: Path) -> None:
    file = next(f for f in sorted(out.glob("forms/yolo-seg/views/*/labels/*.txt")) if f.read_text())
    number, *shares = file.read_text().splitlines()[0].split(" ")
    moved = [f"{float(v) + 0.1 * (k % 2):.6f}" for k, v in enumerate(shares)]
    file.write_text(
        " ".join([number, *moved]) + "\n" + "".join(file.read_text().splitlines(True)[1:])
    )


def _other_normals(out: Path) -> None:
    file = _one(out, "forms/marigold/views/*/*/normal_*.npy")
    np.save(file, np.load(file)[:, ::-1])


def _other_hdf5(out: Path) -> None:
    import h5py

    with h5py.File(_one(out, "forms/hdf5/views/*/0.hdf5"), "r+") as file:
        file["depth"][...] = file["depth"][()] * 1.01


def _class_of_row(document: dict[str, Any]) -> None:
    row = document["annotations"][0]
    row["category_id"] = row["category_id"] % 40 + 1


def _turned(frames: dict[str, Any]) -> None:
    frames["frames"][0]["transform_matrix"][0][3] += 0.01


def _other_pose(out: Path) -> None:
    file = _one(out, "forms/openspatial/views/*/pose/*/*.txt")
    pose = np.loadtxt(file)
    pose[0, 3] += 0.01
    np.savetxt(file, pose, "%.12g")


def _all_covisible(out: Path) -> None:
    file = _one(out, "forms/wai/views/*/*/covisibility/v0/*.npy")
    np.save(file, np.ones_like(np.load(file)))


def _nearer_logarithms(out: Path) -> None:
    file = _one(out, "forms/moge/views/*/*/*/depth.png")
    with Image.open(file) as image:
        near, far, steps = image.info["near"], image.info["far"], np.array(image)
    nearer = np.where((steps > 9) & (steps < 65535), steps - 9, steps).astype(np.uint16)
    file.write_bytes(png_from_array(nearer, texts={"near": near, "far": far}))


def _kept_after_all(out: Path) -> None:
    file = out / "parts/views/selection/small.jsonl"
    file.write_text(file.read_text().replace('"kept":true', '"kept":false', 1))


COCO, HALF = "forms/coco/views/*/annotations.json", "forms/half/views/*/annotations.json"

# fmt: off
FALSEHOODS: dict[str, tuple[Plant, str]] = {
    "answer of a question": (_other_answer, "questions"),
    "answer in one file of the questions": (_text("forms/questions/views/*/conversations.jsonl", '"gpt", "value": "', '"gpt", "value": "9'), "questions"),
    "phrase of another noun": (_other_phrase, "references"),
    "box moved by 5 px": (_json(COCO, _moved_box), "form boxes"),
    "box of a resized picture moved by 5 px": (_json(HALF, _moved_box), "form boxes"),
    "line of YOLO moved by 5 px": (_moved_line, "form boxes"),
    "polygon moved": (_moved_polygon, "form boxes"),
    "mask of another item": (_json(COCO, lambda d: d["annotations"][0].update(segmentation=d["annotations"][1]["segmentation"])), "form masks"),
    "panoptic ids mirrored": (_png("forms/coco/views/*/panoptic/*/*.png", lambda a: a[:, ::-1]), "form masks"),
    "mask of classes moved": (_png("forms/yolo-semantic/views/*/masks/*.png", lambda a: np.roll(a, 3, 1)), "form masks"),
    "depth scaled in one form": (_png("forms/yolo-depth/views/*/depth/*.png", lambda a: a * 1.01), "form depth"),
    "depth scaled in a shard": (_shard("depth.npz", _scaled_npz), "form depth"),
    "depth in a table": (_columns(_nearer), "form depth"),
    "depth scaled in HDF5": (_other_hdf5, "form depth"),
    "normals mirrored": (_other_normals, "form normals"),
    "row of another split": (_text("index.csv", ",val,", ",train,"), "splits"),
    "files in the folder of another split": (_to_the_other_split, "form views"),
    "labels of a view left out": (lambda out: _one(out, "forms/yolo/views/*/labels/*.txt").unlink(), "form views"),
    "document left out": (lambda out: _one(out, "forms/coco/views/*/panoptic.json").unlink(), "coco"),
    "view left out of a form": (_json(COCO, _without_image), "form views"),
    "view left out of the index": (lambda out: (out / "index.csv").write_text("".join((out / "index.csv").read_text().splitlines(True)[:-1])), "index"),
    "selection of a view": (_kept_after_all, "index"),
    "count in the card": (_text("README.md", "| views | val | 1 | 1 | 2 |", "| views | val | 1 | 1 | 3 |"), "card"),
    "licence left out": (_text("README.md", "Licence: CC0.\n", ""), "card"),
    "title in the set's file": (_text("small.toml", 'title = "Small"', 'title = "Large"'), "card"),
    "recipe in the card": (_text("README.md", "preset paper", "preset photo"), "card"),
    "a darker patch": (_png("forms/coco/views/*/images/*/*.png", lambda a: np.where(np.arange(128)[:, None] < 9, a // 2, a)), "form pictures"),
    "pictures of two views exchanged": (_swap("forms/yolo/views/val/images/*.png"), "form pictures"),
    "pictures of a shard": (_shard("opengl_dl.png", lambda data: png_from_array(255 - array_from_png(data))), "form pictures"),
    "focal length": (_json(COCO, lambda d: d["images"][0]["K"][0].__setitem__(0, 60.0)), "form cameras"),
    "focal length of a shard": (_shard("json", _other_k), "form cameras"),
    "camera of a table": (_columns(lambda row: row.update(camera=_other_k(row["camera"].encode()).decode())), "form cameras"),
    "pose of a frame": (_json("forms/nerfstudio/views/*/*/transforms.json", _turned), "form cameras"),
    "pose of a file": (_other_pose, "form cameras"),
    "pose of a frame of wai": (_json("forms/wai/views/*/*/scene_meta.json", _turned), "form cameras"),
    "centre of a picture in shares": (_json("forms/moge/views/*/*/*/meta.json", lambda d: d["intrinsics"][0].__setitem__(2, 0.49)), "form cameras"),
    "frames that see each other": (_all_covisible, "form covisibility"),
    "logarithmic depth": (_nearer_logarithms, "form depth"),
    "lossy pictures of two views exchanged": (_swap("forms/moge/views/*/*/*/image.jpg"), "form pictures"),
    "normals of two views exchanged": (_swap("forms/moge/views/*/*/*/normal.png"), "form normals"),
    "name of a class": (_json(COCO, lambda d: d["categories"][6].update(name="desk")), "form classes"),
    "name of a class of YOLO": (_text("forms/yolo/views/data.yaml", "6: table", "6: desk"), "form classes"),
    "name of a class of shards": (_json("forms/shards/views/dataset.json", lambda d: d["classes"].__setitem__(7, "desk")), "form classes"),
    "class of an instance": (_json(COCO, _class_of_row), "form classes"),
    "licence of a home": (_json(COCO, lambda d: d["licenses"].append({"id": 1, "name": "CC0", "url": ""})), "form licences"),
    "pairs of a list": (_text("forms/marigold/views/val/filename_list_val.txt", "depth_0_0_5", "depth_0_1_0"), "form views"),
    "views of a shard": (_json("forms/shards/views/dataset.json", lambda d: d["shards"][0].update(n_views=7)), "form views"),
}
UNSIGNED: dict[str, tuple[Plant, str]] = {
    "file missing": (lambda out: _one(out, "forms/coco/views/*/images/*/*.png").unlink(), "checksums"),
    "file of a part missing": (lambda out: _one(out, "parts/views/houses/*/views/*/normal.png").unlink(), "checksums"),
    "depth of a part": (_png("parts/views/houses/*/views/*/depth.png", lambda a: a * 1.01), "form depth"),
    "extra file": (lambda out: (out / "forms/coco/notes.txt").write_text("mine"), "checksums"),
    "damaged file": (_text("forms/yolo/views/data.yaml", "table", "TABLE"), "checksums"),
    "digest of a marker": (_json("done/coco.views.json", lambda d: d["files"].update({next(iter(d["files"])): "0" * 64})), "markers of steps"),
}
# fmt: on
KINDS = FALSEHOODS | UNSIGNED


def sign(out: Path) -> None:
    """Make SHA256SUMS and the markers of a set agree with its files."""
    stored = stored_set(out)
    assert stored is not None
    sums = {f: hashlib.sha256((out / f).read_bytes()).hexdigest() for f in stored.files()}
    (out / "SHA256SUMS").write_text("".join(f"{d}  {f}\n" for f, d in sorted(sums.items())))
    for marker in out.glob("done/*.json"):
        edit_json(marker, lambda m: m.update(files={f: sums[f] for f in m["files"] if f in sums}))


def planted(out: Path, kind: str) -> set[str]:
    """The failing checks of the set itself after a falsehood is planted in it."""
    plant, _check = KINDS[kind]
    plant(out)
    if kind in FALSEHOODS:
        sign(out)
    stored, tally = stored_set(out), Tally()
    assert stored is not None
    check_set(stored, tally)
    counts = tally.certificate("", 0, 0, all_pixels=False).counts
    return {name for name, count in counts.items() if count.failed}
