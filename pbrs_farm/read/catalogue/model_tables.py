"""Tables that describe models: catalogue.csv, 3D-FUTURE, HSSD, objathor. Effects: reads tables.

`catalogue.csv` (or the only CSV of the folder with a column `file`): file, and any of name,
class (or group), size or width, depth, height (cm), front, creator, licence. `model_info.json` is
3D-FUTURE's, `objects.csv` HSSD's, `annotations.json` (`.gz`) objathor's. With one of these three
only listed models are pieces; with catalogue.csv all models are.
"""

from __future__ import annotations

import csv
import gzip
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pbrs_farm.core.classes import NYU40_NAMES
from pbrs_farm.core.errors import BadHouse, BadInput
from pbrs_farm.read.common.given_classes import HSSD_TABLES, given_class, hssd_rows
from pbrs_farm.read.common.json_values import bounded_json
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.regular_files import MAX_TEXT_BYTES, fault_of, read_regular, text_from_bytes

Size = tuple[float, float, float]

TABLE: Final = "catalogue.csv"
_INFO: Final = ("model_info.json", "3D-FUTURE-model/model_info.json")
_ANNOTATIONS: Final = ("annotations.json", "annotations.json.gz")
_MAX_BYTES: Final = 256_000_000  # of a table, unpacked
_MOST_M: Final = 50.0
_AXES: Final = {"+z": 0, "z": 0, "+x": 3, "x": 3, "-z": 2, "-x": 1}


@dataclass(frozen=True, slots=True)
class ModelRow:
    """A table's row for a model; missing fields are "" or None. quarters: turns by 90 degrees to face +z."""

    name: str = ""
    group: str = ""  # a group or a class, of the user's own table: it is taken at its word
    label: str = ""  # the class that a data set's vocabulary gives: its size must fit
    size: Size | None = None
    quarters: int = 0
    creator: str = ""
    licence: str = ""


@dataclass(frozen=True, slots=True)
class ModelTable:
    """A folder's table by file; is_whole: models without a row are not pieces."""

    rows: Mapping[str, ModelRow]
    is_whole: bool = False


def model_table(path: Path, notes: Notes) -> ModelTable:
    """The table of a folder of models, empty if there is none; faults become notes.

    Searched in turn: catalogue.csv, 3D-FUTURE's, HSSD's, objathor's, and last a single CSV file that
    names model files. If the table is damaged, models are classified by their names.
    """
    for names, read in (
        ((TABLE,), _own),
        (_INFO, _future),
        (HSSD_TABLES, _hssd),
        (_ANNOTATIONS, _objathor),
    ):
        for name in names:
            if (path / name).exists():
                return _read_model_table(path, name, read, notes)
    tables = [f for f in sorted(path.glob("*.csv"))[:8] if _names_files(f)]
    return (
        _read_model_table(path, tables[0].name, _own, notes) if len(tables) == 1 else ModelTable({})
    )


def _read_model_table(path: Path, name: str, read: Any, notes: Notes) -> ModelTable:
    try:
        table: ModelTable = read(path, name, notes)
    except (BadHouse, BadInput, OSError, ValueError, KeyError, csv.Error, EOFError) as error:
        why = fault_of(error) if isinstance(error, OSError) and error.strerror else str(error)
        notes.add("damaged-table", name, why)
        return ModelTable({})
    if table.is_whole:
        missing = [file for file in table.rows if not (path / file).is_file()]
        if missing:
            text = f"{len(missing)} of its {len(table.rows)} models are missing, e.g. {missing[0]}"
            notes.add("missing-models", name, text)
        return ModelTable({k: v for k, v in table.rows.items() if k not in set(missing)}, True)
    return table


def _names_files(file: Path) -> bool:
    try:
        with file.open("rb") as stream:
            head = text_from_bytes(stream.readline(4096), "replace")
            return "file" in head.lower().strip().split(",")
    except OSError:
        return False


def _own(path: Path, name: str, notes: Notes) -> ModelTable:
    text = text_from_bytes(read_regular(path / name, MAX_TEXT_BYTES))
    rows = list(csv.DictReader(text.splitlines()))
    if rows and "file" not in rows[0]:
        raise ValueError("has no column `file`")
    models: dict[str, ModelRow] = {}
    for row in rows:
        cells = {
            k.strip().lower(): (v or "").strip() for k, v in row.items() if k and isinstance(v, str)
        }
        try:
            models[cells["file"]] = ModelRow(
                name=cells.get("name", ""),
                group=cells.get("group", "") or cells.get("class", ""),
                size=_size_cm(cells),
                quarters=_quarters(cells.get("front", "")),
                creator=cells.get("creator", ""),
                licence=cells.get("licence", ""),
            )
        except ValueError as error:
            notes.add(
                "damaged-row",
                f"{name}: {cells.get('file', '')}",
                f"{error}: its other models are read",
            )
    return ModelTable(models)


def _size_cm(cells: Mapping[str, str]) -> Size | None:
    words = [cells.get(key, "") for key in ("width", "depth", "height")]
    if not any(words) and cells.get("size"):
        words = cells["size"].lower().replace("x", " ").replace(",", " ").split()
    if not any(words):
        return None
    if len(words) != 3:
        raise ValueError("a size is width, depth and height in cm")
    width, depth, height = (float(word) / 100 for word in words)
    if not all(0 < v < _MOST_M for v in (width, depth, height)):
        raise ValueError("a size is not between 0 and 50 m")
    return width, depth, height


def _quarters(text: str) -> int:
    """Turns from a front: an axis ("-x"), or a vector of three numbers."""
    word = text.lower().strip()
    if not word:
        return 0
    if word in _AXES:
        return _AXES[word]
    numbers = [float(v) for v in word.replace(",", " ").split()]
    if len(numbers) != 3 or abs(numbers[1]) > 0.5 * max(abs(numbers[0]), abs(numbers[2])):
        raise ValueError(f"front {text!r} is not an axis: +z, -z, +x or -x")
    x, _y, z = numbers
    return (_AXES["+z" if z > 0 else "-z"]) if abs(z) >= abs(x) else _AXES["+x" if x > 0 else "-x"]


def _future(path: Path, name: str, notes: Notes) -> ModelTable:
    """3D-FUTURE: a list of model_id, super-category, category; raw_model.obj in metres, front to +z."""
    rows = bounded_json(_data(path / name), name)
    folder = name.rpartition("/")[0]
    models = {}
    for row in rows if isinstance(rows, list) else []:
        if isinstance(row, dict) and _is_plain(str(row.get("model_id", ""))):
            category = str(row.get("category") or "")
            above = str(row.get("super-category") or "")
            label_class = given_class("3dfuture", category) or given_class("3dfuture-super", above)
            file = "/".join(filter(None, (folder, str(row["model_id"]), "raw_model.obj")))
            label = NYU40_NAMES[label_class.nyu40] if label_class and label_class.nyu40 > 0 else ""
            models[file] = ModelRow(name=category or above, label=label, creator="3D-FUTURE")
    return ModelTable(models, is_whole=True)


def _hssd(path: Path, name: str, notes: Notes) -> ModelTable:
    """HSSD: an id a row and its category; models in objects/, by the id's first character."""
    models = {}
    for uid, category, _size in hssd_rows(_data(path / name)):
        if not _is_plain(uid):
            continue
        words = category.replace("_", " ")
        ways = (f"objects/{uid[0]}/{uid}.glb", f"objects/{uid}.glb", f"{uid}.glb")
        file = next((w for w in ways if (path / w).is_file()), ways[0])
        quarters = _front_of_config(path / file.replace(".glb", ".object_config.json"))
        models[file] = ModelRow(name=words, label=words, quarters=quarters, creator="HSSD")
    return ModelTable(models, is_whole=True)


def _front_of_config(file: Path) -> int:
    """Quarter turns for the front given in a model's own configuration, in its axes; 0 if not given."""
    try:
        front = json.loads(read_regular(file, 1_000_000)).get("front")
        return _quarters(" ".join(map(str, front))) if isinstance(front, list) else 0
    except (OSError, ValueError, AttributeError, RecursionError):
        return 0


def _objathor(path: Path, name: str, notes: Notes) -> ModelTable:
    """objathor: id -> annotation with its category; GLB beside it or in assets/. Pickles are refused."""
    rows = bounded_json(_data(path / name), name)
    if not isinstance(rows, dict):
        raise ValueError("has no annotations by id")
    models, pickles = {}, 0
    for uid, row in rows.items():
        if not (_is_plain(uid) and isinstance(row, dict)):
            continue
        ways = [
            f"{folder}{uid}{end}" for folder in ("", "assets/") for end in (".glb", f"/{uid}.glb")
        ]
        file = next((w for w in ways if (path / w).is_file()), "")
        if not file:
            packed = [f"{folder}{uid}/{uid}.pkl.gz" for folder in ("", "assets/")]
            pickles += any((path / w).is_file() for w in packed)
        words = str(row.get("category") or row.get("ref_category") or "").replace("_", " ")
        label_class = given_class("ai2thor", words)
        label = NYU40_NAMES[label_class.nyu40] if label_class and label_class.nyu40 > 0 else ""
        models[file or ways[0]] = ModelRow(name=words, label=label or words, creator="objathor")
    if pickles:
        text = f"{pickles} models are pickles, which may contain programs: convert them to GLB"
        notes.add("refused-pickles", name, text)
    return ModelTable(models, is_whole=True)


def _is_plain(name: str) -> bool:
    """Whether a model's id is a name and no path."""
    return bool(name) and name.replace("-", "").replace("_", "").isalnum()


def _data(file: Path) -> bytes:
    data = read_regular(file, _MAX_BYTES)
    if file.suffix != ".gz":
        return data
    with gzip.open(io.BytesIO(data)) as stream:
        plain = stream.read(_MAX_BYTES + 1)
    if len(plain) > _MAX_BYTES:
        raise ValueError("is too large")
    return plain
