"""Forms that hold many views in a file: tar shards, Parquet, HDF5. Effects: reads files."""

from __future__ import annotations

import io
import json
import tarfile
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.check.cases import FormCase
from pbrs_farm.check.checks import Check
from pbrs_farm.check.form_truth import FormTruth
from pbrs_farm.check.rules import judge
from pbrs_farm.check.stored_files import (
    object_from_json,
    stored_bytes,
    stored_digest,
    stored_object,
)
from pbrs_farm.check.stored_set import MODES, PACKED
from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.layers import LAYER
from pbrs_farm.images import array_from_png

_NAMES = {"normals": "normal", "instance_segmaps": "instance", "category_id_segmaps": "semantic"}
_CHECKS_OF = {"depth": "form depth", "normal": "form normals", "valid": "form normals"}
_JPEG_HEAD = b"\xff\xd8"
_JPEG = 12  # mean difference of a lossy picture, of 255


def check_packed(case: FormCase) -> None:
    """Every view of every shard or table, in the split that its file names; dataset.json's sizes and digests."""
    if case.form.to not in (*PACKED, "webdataset", "hdf5"):
        return
    samples = {"parquet": _parquet, "hdf5": _hdf5}.get(case.form.to, _tars)
    shown: list[str] = []
    names: Collection[str] = ()
    for file, key, parts in samples(case):
        view = case.view(key)
        place = f"{case.place(file)} {key}"
        is_kept = case.tally.expect("form views", place, view is not None, "is of no kept view")
        if not is_kept or view is None:
            continue
        shown.append(key)
        if case.form.to in PACKED:
            split = Path(file).name.partition("-")[0]
            whole = {"shards": "all", "parquet": "train"}[case.form.to]
            right = case.split_of(view.folder.parents[1].name) or whole
            case.tally.expect("splits", place, split == right, f"is in {split}, not {right}")
        truth, names = FormTruth(view, case.form.size), names or parts.keys()
        fits = case.form.to == "webdataset" or parts.keys() == names
        case.tally.expect(
            "packed forms", place, fits, f"has other parts than the first: {sorted(parts)}"
        )
        for part, value in parts.items():
            _check_part(case, place, truth, part, value)
    lacking = sorted(case.keys.keys() - set(shown))
    complete = [key for key in lacking if _has_packed(case, key)]
    fits = not complete and len(shown) == len(set(shown))
    case.tally.expect("form views", case.place(), fits, f"lacks {complete[:3]}, or repeats a view")
    if case.form.to == "shards":
        _check_dataset(case)


def _has_packed(case: FormCase, key: str) -> bool:
    """True if a view has a picture in each mode of the pack; labels it has as any view."""
    view = case.view(key)
    modes = case.form.options.get("modes") or ()
    return view is not None and all(view.has(f"{mode}.png") for mode in modes)


def _check_dataset(case: FormCase) -> None:
    document = stored_object(case.folder / "dataset.json")
    place = case.place("dataset.json")
    fits = document["classes"] == list(NYU40_NAMES)
    case.tally.expect("form classes", place, fits, "has other classes")
    for row in document["shards"]:
        file = case.folder / Path(row["file"]).name
        with tarfile.open(file) as tar:
            n = sum(name.endswith(".json") for name in tar.getnames())
        facts = row["split"], row["n_views"], row["n_bytes"], row["sha256"]
        disk = file.name.partition("-")[0], n, file.stat().st_size, stored_digest(file)
        case.tally.expect("form views", place, facts == disk, f"{file.name} is {disk}, not {facts}")


Sample = tuple[str, str, Mapping[str, Any]]
"""File, `<house>__<view>`, and part -> bytes or array."""


def _tars(case: FormCase) -> Iterator[Sample]:
    keys = {key.replace(".", "_"): key for key in case.keys}
    for file in (f for f in case.files if f.endswith(".tar")):
        parts: dict[str, dict[str, bytes]] = {}
        with tarfile.open(case.folder / file) as tar:
            for member in tar:
                stem, _, part = member.name.partition(".")
                data = tar.extractfile(member)
                parts.setdefault(stem, {})[part] = data.read() if data else b""
                if len(parts) > 1:  # one view at a time
                    done = next(iter(parts))
                    yield file, keys.get(done, done), parts.pop(done)
        for stem, of in parts.items():
            yield file, keys.get(stem, stem), of


def _parquet(case: FormCase) -> Iterator[Sample]:
    import pyarrow.parquet as pq

    for file in (f for f in case.files if f.endswith(".parquet")):
        for batch in pq.ParquetFile(case.folder / file).iter_batches(batch_size=1):
            row = {name: batch.column(name) for name in batch.schema.names}
            key = str(row["id"][0]).replace("/", "__")
            camera = object_from_json(str(row["camera"][0]))
            names = {"house": str(row["house"][0]), "room": str(row["room"][0])}
            names["view"] = key.removeprefix(f"{names['house']}__")
            parts: dict[str, Any] = {"json": json.dumps(camera | names).encode()}
            for name in row.keys() - {"id", "house", "room", "camera"}:
                values = row[name]
                if name in MODES:
                    data = values[0].as_py()["bytes"]
                    parts[f"{name}.{'jpg' if data[:2] == _JPEG_HEAD else 'png'}"] = data
                    continue
                while hasattr(values, "offsets"):
                    values = values.flatten()
                shape = (camera["height_px"], camera["width_px"], 3)[: 3 if name == "normal" else 2]
                parts[name] = values.to_numpy(zero_copy_only=False).reshape(shape)
            yield file, key, parts


def _hdf5(case: FormCase) -> Iterator[Sample]:
    import h5py

    for line in stored_bytes(case.folder / "index.jsonl").splitlines():
        row = object_from_json(line)
        with h5py.File(case.folder / Path(row["file"]).name) as file:
            parts = {name: file[name][()] for name in file}
        yield row["file"], f"{row['house']}__{row['view']}", parts


def _check_part(case: FormCase, place: str, truth: FormTruth, part: str, value: Any) -> None:
    """A member of a shard, a column or a data set against the view."""
    name = part.partition(".")[0]
    if part in ("json", "campose"):
        _check_facts(case, place, truth, part, object_from_json(value))
    elif case.form.to == "webdataset" and truth.size is None:
        fits = value == stored_bytes(truth.view.folder / LAYER[name].file)
        case.tally.expect(_check_of(name), f"{place}.{part}", fits, "is not the view's file")
    else:
        for array_name, array in _arrays(part, value).items():
            _check_array(case, f"{place} {array_name}", truth, array_name, array)


def _arrays(part: str, value: Any) -> dict[str, NDArray[Any]]:
    """The arrays of a part by name; {} for other files."""
    name, _dot, ending = part.partition(".")
    if ending == "npz":
        return dict(np.load(io.BytesIO(value), allow_pickle=False))
    if ending == "png":
        return {name: array_from_png(value, part)}
    if ending == "jpg":
        from PIL import Image

        return {name: np.asarray(Image.open(io.BytesIO(value), formats=["JPEG"]).convert("RGB"))}
    return {name: value} if isinstance(value, np.ndarray) else {}


def _check_array(
    case: FormCase, place: str, truth: FormTruth, name: str, array: NDArray[Any]
) -> None:
    name, check = _NAMES.get(name, name), _check_of(_NAMES.get(name, name))
    if name == "colors":
        name = truth.mode(case.form.options.get("modes") or MODES) or ""
    wanted, within = truth.array(name), 1.0 if check == "form pictures" else 1e-4
    if wanted is None:
        return
    if case.form.to == "hdf5" and name == "depth":
        wanted = wanted / 1000
    if case.form.to == "hdf5" and name == "normal":
        valid = truth.label("valid.png") > 0
        wanted = np.where(valid[..., None], (truth.opengl_normals() + 1) / 2, 0)
    if str(case.form.options.get("colour", "")).startswith("jpeg") and check == "form pictures":
        off = np.abs(array.astype(np.float64) - wanted).mean()
        case.tally.expect(check, place, off < _JPEG, f"differs by {off:.1f} of 255")
    else:
        case.compare(check, place, array, wanted, within)


def _check_of(name: str) -> str:
    return "form pictures" if name in (*MODES, "colors") else _CHECKS_OF.get(name, "form masks")


def _check_facts(
    case: FormCase, place: str, truth: FormTruth, part: str, stored: dict[str, Any]
) -> None:
    """The JSON of a view: camera and size; of WebDataset view.json itself."""
    facts = truth.facts | {"room": truth.facts.get("room") or ""}
    if case.form.to == "webdataset" and truth.size is None:
        case.tally.expect("form cameras", place, stored == truth.view.table, "is not view.json")
        return
    if part == "campose":
        k = np.array(facts["K"]) - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
        judge("form campose", place, case.tally, row=stored, k=k.tolist(), facts=facts)
        return
    judge("form facts", place, case.tally, row=stored, facts=facts)
    names = "id", "pixels", "box2d", "nyu40", "class"
    rows, wanted = (
        [{n: r[n] for n in names} for r in of.get("instances", ())] for of in (stored, facts)
    )
    fits = "instances" not in stored or rows == wanted
    case.tally.expect("form boxes", place, fits, "has other instances than the view")


CHECKS = (Check("packed forms", "form", check_packed, 11, ("NYU40",)),)
