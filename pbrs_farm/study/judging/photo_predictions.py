"""Predictions of a run for photographs, resized to the training's number of pixels. Effects: files, a page."""

from __future__ import annotations

import io
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pbrs_farm.core.arrays import F32, F64, Srgb8Image
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.gallery.gallery_page import data_url
from pbrs_farm.images import decode_photo, jpeg_from_array, png_from_array
from pbrs_farm.regular_files import read_given
from pbrs_farm.study.judging.evaluation import Trained
from pbrs_farm.study.real_frames import find_camera
from pbrs_farm.study.tasks.classes_task import class_names
from pbrs_farm.study.training.prediction import predict
from pbrs_farm.study.training.run_folder import make_folder, write_report

SUFFIXES: Final = (".jpg", ".jpeg", ".png", ".bmp", ".tga", ".gif")
_MAX_PIXELS: Final = 100_000_000  # maximum size of a photograph
_MULTIPLE: Final = 32  # of the network's size, which is halved five times
_BATCH: Final = 8
_SHOWN_PX: Final = 960  # maximum width of the page's pictures
_LEAST_SHARE: Final = 0.005  # minimum share of a photograph for a class in its row
_ORIENTATION: Final = 0x0112  # EXIF's tag
_EXIF_IFD: Final = 0x8769
_FOCAL_35MM: Final = 0xA405
_FILM_DIAGONAL_MM: Final = math.hypot(36, 24)


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """An upright picture."""

    name: str  # stem of its output files
    colour: Srgb8Image  # (H, W, 3)
    path: Path = Path()
    focal_35mm: float = 0.0  # EXIF's 35 mm equivalent focal length, mm; 0 = unknown


def photograph_files(words: Sequence[Path]) -> list[Path]:
    """Files, and the pictures of folders by name; BadInput for a folder without a picture."""
    files: list[Path] = []
    for word in words:
        if not word.is_dir():
            files.append(word)
            continue
        pictures = sorted(p for p in word.iterdir() if p.suffix.lower() in SUFFIXES)
        if not pictures:
            raise BadInput(word, "", f"has no picture ({', '.join(SUFFIXES)})")
        files += pictures
    return files


def read_photograph(path: Path, name: str = "") -> Photograph:
    """Read a picture and turn it by its EXIF orientation (name "" = its stem); BadInput for damage."""
    data = read_given(path)
    colour = decode_photo(data, str(path))
    if colour.shape[0] * colour.shape[1] > _MAX_PIXELS:
        text = f"has {colour.shape[1]}x{colour.shape[0]} pixels, at most {_MAX_PIXELS:,} are read"
        raise BadInput(path, "", text)
    orientation, focal = _exif(data)
    return Photograph(name or path.stem, upright(colour, orientation), path, focal)


def upright(colour: Srgb8Image, orientation: int) -> Srgb8Image:
    """(H, W, 3) turned and mirrored by EXIF's orientation 1..8; other numbers change nothing."""
    if orientation in (5, 6, 7, 8):
        colour = colour.transpose(1, 0, 2)
    if orientation in (2, 3, 6, 7):
        colour = colour[:, ::-1]
    if orientation in (3, 4, 7, 8):
        colour = colour[::-1]
    return np.ascontiguousarray(colour)


def _exif(data: bytes) -> tuple[int, float]:
    """Orientation (default 1) and 35 mm equivalent focal length (default 0)."""
    try:
        exif = Image.open(io.BytesIO(data)).getexif()
        orientation = int(exif.get(_ORIENTATION, 1))
    except (OSError, ValueError, TypeError, SyntaxError):
        return 1, 0.0
    try:
        focal = float(exif.get_ifd(_EXIF_IFD).get(_FOCAL_35MM, 0))
    except (OSError, ValueError, TypeError, SyntaxError, KeyError):
        focal = 0.0
    return orientation, focal if math.isfinite(focal) and focal > 0 else 0.0


def camera_of_photograph(
    photograph: Photograph, told_deg: float, assumed_deg: float
) -> tuple[F64, str]:
    """(4,) fx, fy, cx, cy of a photograph in pixels, and their source.

    In this order: told_deg, a horizontal field of view (0 = none); an intrinsics file beside the
    photograph; EXIF's 35 mm equivalent focal length, by the diagonal; assumed_deg. Raises BadInput if
    only assumed_deg is left and it is 0.
    """
    height, width = photograph.colour.shape[:2]
    folder = photograph.path.parent
    camera = None if told_deg else find_camera(folder, folder)
    if camera is not None:
        return np.array(camera.K, np.float64), "intrinsics"
    if told_deg:
        source, f = "told", width / 2 / math.tan(math.radians(told_deg) / 2)
    elif photograph.focal_35mm:
        source, f = "EXIF", photograph.focal_35mm / _FILM_DIAGONAL_MM * math.hypot(width, height)
    elif assumed_deg:
        source, f = "assumed", width / 2 / math.tan(math.radians(assumed_deg) / 2)
    else:
        hint = "--hfov DEG (a phone's main camera: about 65), or intrinsics.json beside it"
        raise BadInput(photograph.path, "", "no field of view known, which metres need", hint=hint)
    return np.array([f, f, width / 2, height / 2]), source


def network_size(height: int, width: int, n_pixels: int) -> tuple[int, int]:
    """(height, width), multiples that all stages divide, of about these proportions and n_pixels."""
    scale = (n_pixels / (height * width)) ** 0.5
    rows, columns = (max(round(n * scale / _MULTIPLE), 1) * _MULTIPLE for n in (height, width))
    # The deepest stage needs two cells.
    return (rows, columns) if max(rows, columns) > _MULTIPLE else (rows, 2 * _MULTIPLE)


def predict_photographs(
    run: Trained, files: Sequence[Path], out: Path, hfov_deg: float = 0.0, *, mirror: bool = False
) -> Iterator[dict[str, Any]]:
    """Write predictions of photographs into out, and a page at the end; yields a row per photograph.

    An unreadable picture gives a row with an "error", and the others continue. The files are
    described in docs/formats/layers.md: NAME_normal.png (16 bits), NAME_semantic.png or
    NAME_nyu13.png (ids), NAME_depth.png (mm) or NAME_edges.png (255 x strength); NAME_shown.png is a
    picture of it. hfov_deg: horizontal field of view of all photographs, for a network with rays; 0 =
    as each file says. Rows of such networks have "hfov_deg" and "camera", its source. mirror: average
    with the predictions of the mirrored pictures. Raises BadInput if out is not writable.
    """
    make_folder(out)
    rows: list[dict[str, Any]] = []
    for batch in _batches(run, files, hfov_deg):
        began = time.perf_counter()
        photographs = [item for item in batch if isinstance(item, Photograph)]
        done = _predicted_rows(run, photographs, out, hfov_deg, mirror=mirror)
        batch_rows = [next(done) if isinstance(item, Photograph) else item for item in batch]
        seconds = (time.perf_counter() - began) / max(len(photographs), 1)
        for row in batch_rows:
            if "error" not in row:
                row["seconds"] = round(seconds, 3)
            rows.append(row)
            yield _without_tiles(row)
    table = [_without_tiles(row) for row in rows]
    write_report(out, "predictions.json", table, _page(run, rows))


def _without_tiles(row: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in row.items() if key != "tiles"}


def _batches(
    run: Trained, files: Sequence[Path], hfov_deg: float
) -> Iterator[list[Photograph | dict[str, Any]]]:
    """Consecutive photographs of one network size, and rows of errors between them."""
    batch: list[Photograph | dict[str, Any]] = []
    item: Photograph | dict[str, Any]
    batch_size: tuple[int, int] | None = None
    for path, name in zip(files, _output_names(files), strict=True):
        size = batch_size
        try:
            item = read_photograph(path, name)
            size = _size(run, item)
            if run.plan.rays:
                _camera(run, item, hfov_deg)
        except BadInput as error:
            item = {"photograph": shown(str(path), MAX_PLACE), "error": str(error)}
        if batch and (len(batch) == _BATCH or size != batch_size):
            yield batch
            batch = []
        batch.append(item)
        batch_size = size
    if batch:
        yield batch


def _output_names(files: Sequence[Path]) -> list[str]:
    """A unique name per file: its stem, with a number if another file has that."""
    names: list[str] = []
    for path in files:
        name, k = path.stem, 2
        while name in names:
            name, k = f"{path.stem}-{k}", k + 1
        names.append(name)
    return names


def _size(run: Trained, photograph: Photograph) -> tuple[int, int]:
    height, width = photograph.colour.shape[:2]
    return network_size(height, width, run.plan.width_px * run.plan.height_px)


def _predicted_rows(
    run: Trained, photographs: Sequence[Photograph], out: Path, hfov_deg: float, *, mirror: bool
) -> Iterator[dict[str, Any]]:
    """Write the predictions of photographs of one network size; their rows."""
    if not photographs:
        return
    height, width = _size(run, photographs[0])
    small = np.stack([resized_by_area(p.colour, width, height) for p in photographs])
    sizes = [(int(p.colour.shape[0]), int(p.colour.shape[1])) for p in photographs]
    facts: list[dict[str, Any]] = [{} for _ in photographs]
    scaled: F32 | None = None
    if run.plan.rays:
        cameras = [_camera(run, p, hfov_deg) for p in photographs]
        facts = [_camera_facts(p, *c) for p, c in zip(photographs, cameras, strict=True)]
        factors = np.array([[width / w, height / h] * 2 for h, w in sizes])
        scaled = (np.stack([K for K, _ in cameras]) * factors).astype(np.float32)
    predictions = predict(run.network, small, run.task, run.plan, sizes, scaled, mirror=mirror)
    for photograph, prediction, row in zip(photographs, predictions, facts, strict=True):
        yield _written(run, photograph, prediction, out) | row | {"mirror": mirror}


def _camera(run: Trained, photograph: Photograph, hfov_deg: float) -> tuple[F64, str]:
    """As camera_of_photograph; a lens is assumed unless metres would depend on it."""
    assumed_deg = 0 if run.plan.rays and run.task.name == "depth" else run.plan.hfov_deg
    return camera_of_photograph(photograph, hfov_deg, assumed_deg)


def _camera_facts(photograph: Photograph, camera: F64, source: str) -> dict[str, Any]:
    half = photograph.colour.shape[1] / 2 / camera[0]
    return {"hfov_deg": round(math.degrees(2 * math.atan(half)), 1), "camera": source}


def _written(
    run: Trained, photograph: Photograph, prediction: NDArray[Any], out: Path
) -> dict[str, Any]:
    """Write the files of one photograph; its row."""
    name, task, plan = photograph.name, run.task, run.plan
    picture, file = task.picture(prediction), f"{name}_{task.file_kind(plan)}.png"
    row: dict[str, Any] = {"photograph": name}
    if task.name == "segmentation":
        names = class_names(plan)
        shares = np.bincount(prediction.ravel(), minlength=len(names)) / prediction.size
        common = [k for k in np.argsort(-shares).tolist() if shares[k] >= _LEAST_SHARE and k]
        row["classes"] = {names[k]: round(float(shares[k]), 4) for k in common}
    (out / file).write_bytes(png_from_array(task.stored(prediction)))
    (out / f"{name}_shown.png").write_bytes(png_from_array(picture))
    row |= {"file": file, "size": [picture.shape[1], picture.shape[0]]}
    return row | {"tiles": [_url(photograph.colour), _url(picture)]}


def _url(picture: Srgb8Image) -> str:
    height, width = picture.shape[:2]
    shown_width = min(width, _SHOWN_PX)
    small = resized_by_area(picture, shown_width, max(round(height * shown_width / width), 1))
    return data_url(jpeg_from_array(small, 88), "jpeg")


def _page(run: Trained, rows: Sequence[dict[str, Any]]) -> str:
    """HTML of every photograph beside its prediction, pictures included."""
    from pbrs_farm.gallery.html_page import page

    cards = [row | {"classes": row.get("classes", {})} for row in rows if "tiles" in row]
    failed = [row for row in rows if "error" in row]
    package, file = "pbrs_farm.study.judging", "photo_predictions.html"
    return page(package, file, run=run.record, cards=cards, failed=failed)
