"""What a finished run sees in photographs: files and a page a folder. Effects: reads photographs, writes files.

A photograph keeps its proportions: the network gets it at about as many pixels as it trained on, and
what it says is enlarged to the photograph's own size.
"""

from __future__ import annotations

import base64
import io
import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from pbrs_farm.core.arrays import F64, Srgb8Image
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.core.shown_text import MAX_PLACE, shown
from pbrs_farm.formats.layer_file import layer_bytes
from pbrs_farm.images import decode_photo, jpeg_from_array, png_from_array
from pbrs_farm.regular_files import read_given
from pbrs_farm.study.judging.evaluation import Trained
from pbrs_farm.study.judging.others_predictions import file_kind
from pbrs_farm.study.real_frames import find_camera
from pbrs_farm.study.tasks.classes_task import class_names
from pbrs_farm.study.training.prediction import predict
from pbrs_farm.study.training.run_folder import make_folder

SUFFIXES: Final = (".jpg", ".jpeg", ".png", ".bmp", ".tga", ".gif")
_MAX_PIXELS: Final = 100_000_000  # of a photograph; more is refused
_MULTIPLE: Final = 32  # of pixels: what the networks halve five times
_BATCH: Final = 8
_SHOWN_PX: Final = 960  # width of the page's pictures
_LEAST_SHARE: Final = 0.005  # of a photograph that a class covers to be named
_ORIENTATION: Final = 0x0112  # EXIF's tag
_EXIF_IFD: Final = 0x8769
_FOCAL_35MM: Final = 0xA405
_FILM_DIAGONAL_MM: Final = math.hypot(36, 24)


@dataclass(frozen=True, slots=True, eq=False)
class Photograph:
    """A picture as a person would look at it."""

    name: str  # of its files: the picture's own, without a suffix
    colour: Srgb8Image  # (H, W, 3)
    path: Path = Path()
    focal_35mm: float = (
        0.0  # mm, of a camera of 35 mm film that sees as much, by EXIF; 0 = not told
    )


def photograph_files(words: Sequence[Path]) -> list[Path]:
    """The pictures that paths name: files as they are, of folders each picture, by name.

    Raises BadInput for a path that is none, and for a folder without a picture.
    """
    files: list[Path] = []
    for word in words:
        if not word.is_dir():
            files.append(word)
            continue
        found = sorted(p for p in word.iterdir() if p.suffix.lower() in SUFFIXES)
        if not found:
            raise BadInput(word, "", f"holds no picture ({', '.join(SUFFIXES)})")
        files += found
    return files


def read_photograph(path: Path, name: str = "") -> Photograph:
    """The picture, turned as its EXIF orientation says. Raises BadInput naming the file.

    (H, W, 3) uint8 sRGB. BadInput too for more pixels than are read, before the network is asked.
    Its name is the file's stem unless one is given.
    """
    data = read_given(path)
    colour = decode_photo(data, str(path))
    if colour.shape[0] * colour.shape[1] > _MAX_PIXELS:
        text = f"has {colour.shape[1]}x{colour.shape[0]} pixels, at most {_MAX_PIXELS:,} are read"
        raise BadInput(path, "", text)
    orientation, focal = _exif(data)
    return Photograph(name or path.stem, upright(colour, orientation), path, focal)


def upright(colour: Srgb8Image, orientation: int) -> Srgb8Image:
    """The picture as EXIF's orientation 1..8 turns and mirrors it; any other leaves it.

    colour is (H, W, 3); 5 to 8 swap height and width. A copy unless nothing changes.
    """
    if orientation in (5, 6, 7, 8):
        colour = colour.transpose(1, 0, 2)
    if orientation in (2, 3, 6, 7):
        colour = colour[:, ::-1]
    if orientation in (3, 4, 7, 8):
        colour = colour[::-1]
    return np.ascontiguousarray(colour)


def _exif(data: bytes) -> tuple[int, float]:
    """Orientation, 1 where it is not told, and the focal length for 35 mm film, 0 likewise."""
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
    """(4,) fx, fy, cx, cy of a photograph in its pixels, and what says so.

    The first that there is: told_deg, a horizontal field of view, 0 = none; an intrinsics file beside the
    photograph or in the folder above; EXIF's focal length for 35 mm film, by the diagonal; assumed_deg.
    """
    height, width = photograph.colour.shape[:2]
    folder = photograph.path.parent
    beside = None if told_deg else find_camera(folder, folder)
    if beside is not None:
        return np.array(beside.K, np.float64), "intrinsics"
    if told_deg:
        said, f = "told", width / 2 / math.tan(math.radians(told_deg) / 2)
    elif photograph.focal_35mm:
        said, f = "EXIF", photograph.focal_35mm / _FILM_DIAGONAL_MM * math.hypot(width, height)
    else:
        said, f = "assumed", width / 2 / math.tan(math.radians(assumed_deg) / 2)
    return np.array([f, f, width / 2, height / 2]), said


def network_size(height: int, width: int, n_pixels: int) -> tuple[int, int]:
    """(height, width) of a photograph for the network: its proportions, near n_pixels, even halves.

    Rounded to a multiple that all stages divide, so proportions hold only nearly. A long thin
    picture keeps at least one multiple across.
    """
    scale = (n_pixels / (height * width)) ** 0.5
    rows, columns = (max(round(n * scale / _MULTIPLE), 1) * _MULTIPLE for n in (height, width))
    # The deepest stage needs two cells.
    return (rows, columns) if max(rows, columns) > _MULTIPLE else (rows, 2 * _MULTIPLE)


def predict_photographs(
    run: Trained, files: Sequence[Path], out: Path, hfov_deg: float = 0.0
) -> Iterator[dict[str, Any]]:
    """Write each photograph's prediction below out, and the page last; a row a photograph as it is done.

    A picture that cannot be read is a row with an "error", and the rest goes on. The files are
    docs/formats/layers.md's: normal.png (16 bits), semantic.png or nyu13.png (ids), depth.png (mm), or edges.png (255 x how likely
    an edge is), each behind the photograph's name; NAME_shown.png is for eyes. hfov_deg: of all
    photographs, for a network that is told rays; 0 = as each says. Its rows have "hfov_deg" and
    "camera", what said so. Raises BadInput where out cannot be written to.
    """
    make_folder(out)
    rows: list[dict[str, Any]] = []
    for batch in _batches(run, files):
        began = time.perf_counter()
        photographs = [one for one in batch if isinstance(one, Photograph)]
        cameras = _cameras(run, photographs, hfov_deg)
        seen = _predicted(run, photographs, [camera for camera, _said in cameras])
        facts = (_camera_facts(one, *c) for one, c in zip(photographs, cameras, strict=False))
        rows += [
            _written(run, one, next(seen), out) | next(facts, {})
            if isinstance(one, Photograph)
            else one
            for one in batch
        ]
        seconds = (time.perf_counter() - began) / max(len(photographs), 1)
        for row in rows[-len(batch) :]:
            if "error" not in row:
                row["seconds"] = round(seconds, 3)
            yield {k: v for k, v in row.items() if k != "tiles"}
    table = [{k: v for k, v in row.items() if k != "tiles"} for row in rows]
    (out / "predictions.json").write_text(json.dumps(table, indent=1) + "\n", "utf-8")
    (out / "index.html").write_text(_page(run, rows), "utf-8")


def _batches(run: Trained, files: Sequence[Path]) -> Iterator[list[Photograph | dict[str, Any]]]:
    """Photographs that the network gets at one size, in their order; a row for what is none."""
    batch: list[Photograph | dict[str, Any]] = []
    size: tuple[int, int] | None = None
    for path, name in zip(files, _output_names(files), strict=True):
        try:
            one: Photograph | dict[str, Any] = read_photograph(path, name)
        except BadInput as error:
            one = {"photograph": shown(str(path), MAX_PLACE), "error": str(error)}
        own = _size(run, one) if isinstance(one, Photograph) else size
        if batch and (len(batch) == _BATCH or own != size):
            yield batch
            batch = []
        batch.append(one)
        size = own
    if batch:
        yield batch


def _output_names(files: Sequence[Path]) -> list[str]:
    """A name a file, its own where no other has it."""
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


def _cameras(
    run: Trained, photographs: Sequence[Photograph], hfov_deg: float
) -> list[tuple[F64, str]]:
    """Of a network that is told rays: the camera of each, and what says so; else none."""
    if not run.plan.rays:
        return []
    return [camera_of_photograph(one, hfov_deg, run.plan.hfov_deg) for one in photographs]


def _camera_facts(photograph: Photograph, camera: F64, said: str) -> dict[str, Any]:
    half = photograph.colour.shape[1] / 2 / camera[0]
    return {"hfov_deg": round(math.degrees(2 * math.atan(half)), 1), "camera": said}


def _predicted(
    run: Trained, photographs: Sequence[Photograph], cameras: Sequence[F64]
) -> Iterator[NDArray[Any]]:
    if not photographs:
        return
    height, width = _size(run, photographs[0])
    small = np.stack([resized_by_area(p.colour, width, height) for p in photographs])
    sizes = [(int(p.colour.shape[0]), int(p.colour.shape[1])) for p in photographs]
    scaled = None
    if cameras:
        factors = np.array([[width / w, height / h] * 2 for h, w in sizes])
        scaled = (np.stack(cameras) * factors).astype(np.float32)
    yield from predict(run.network, small, run.task, run.plan, sizes, scaled)


def _written(
    run: Trained, photograph: Photograph, prediction: NDArray[Any], out: Path
) -> dict[str, Any]:
    """The files of one photograph; its row."""
    name, picture = photograph.name, run.task.picture(prediction)
    kind = file_kind(run.plan)
    row: dict[str, Any] = {"photograph": name}
    if run.task.name == "normals":
        # From OpenCV's axes to the layer's: x right, y forward, z up.
        axes = np.stack([prediction[..., 0], prediction[..., 2], -prediction[..., 1]], axis=-1)
        stored = np.rint((axes.astype(np.float64) + 1) * 65535 / 2).astype(np.uint16)
        data = layer_bytes(kind, stored)
    elif run.task.name == "segmentation":
        names = class_names(run.plan)
        data = layer_bytes(kind, prediction.astype(np.uint8))
        counts = np.bincount(prediction.ravel(), minlength=len(names)) / prediction.size
        named = [k for k in np.argsort(-counts).tolist() if counts[k] >= _LEAST_SHARE and k]
        row["classes"] = {names[k]: round(float(counts[k]), 4) for k in named}
    elif run.task.name == "depth":
        # Layers hold millimetres; what is farther than they can say is the farthest.
        data = layer_bytes(kind, np.clip(np.rint(prediction * 1000), 1, 65535).astype(np.uint16))
    else:
        edges = np.rint(255 * np.clip(np.asarray(prediction, np.float64), 0, 1)).astype(np.uint8)
        data = png_from_array(edges)
    file = f"{name}_{kind}.png"
    (out / file).write_bytes(data)
    (out / f"{name}_shown.png").write_bytes(png_from_array(picture))
    row |= {"file": file, "size": [picture.shape[1], picture.shape[0]]}
    return row | {"tiles": [_url(photograph.colour), _url(picture)]}


def _url(picture: Srgb8Image) -> str:
    height, width = picture.shape[:2]
    shown_width = min(width, _SHOWN_PX)
    small = resized_by_area(picture, shown_width, max(round(height * shown_width / width), 1))
    return "data:image/jpeg;base64," + base64.b64encode(jpeg_from_array(small, 88)).decode()


def _page(run: Trained, rows: Sequence[dict[str, Any]]) -> str:
    """HTML of every photograph beside what is seen in it; every picture is inside it."""
    from pbrs_farm.gallery.html_page import page

    cards = [row | {"classes": row.get("classes", {})} for row in rows if "tiles" in row]
    failed = [row for row in rows if "error" in row]
    return page(
        "pbrs_farm.study.judging",
        "photo_predictions.html",
        run=run.record,
        cards=cards,
        failed=failed,
    )
