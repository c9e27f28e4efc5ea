"""Reads photographs with depth: pairs below a folder (docs/selection.md), or NYUv2's labelled .mat."""

from __future__ import annotations

import io
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm import images
from pbrs_farm.core import keys
from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.errors import BadInput, MachineFailed
from pbrs_farm.core.resampling import resized_by_area
from pbrs_farm.curate import tum_frames
from pbrs_farm.installation import install_command
from pbrs_farm.regular_files import (
    MAX_DIGEST_BYTES,
    digest_of_regular,
    fault_of,
    naming_kind,
    open_regular,
    read_given,
)
from pbrs_farm.selection.reference_set import depth_mm_from_units, sun_rgbd_depth

_RGB_NAMES: Final = ("rgb", "color", "colour", "image", "images")  # names of colour folders
_DEPTH_NAMES: Final = ("depth_bfx", "depth")  # names of depth folders, the preferred first
_RGB_FILES: Final = (".jpg", ".jpeg", ".png", ".bmp")
_DEPTH_FILES: Final = (".png", ".npy", ".exr")
_SAME_FORM: Final = (
    0.02  # maximum relative difference between the aspect ratios of a picture and its depth
)
_SUFFIX: Final = re.compile(r"(.+)_(rgb|color|colour|image|depth)", re.IGNORECASE)  # names of files


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A photograph with depth."""

    id: str
    rgb: Srgb8Image  # (H, W, 3)
    depth_mm: NDArray[np.uint16]  # (H, W), 0 = unknown
    room: str = ""  # of NYUv2's scenes


@dataclass(frozen=True, slots=True)
class PhotoFiles:
    """The two files of one photograph."""

    id: str
    rgb: Path
    depth: Path
    depth_scale: float | None = None  # units per metre, if the layout defines it


def has_depth(folder: Path) -> bool:
    """True if the folder contains a depth picture, by the name of the file or of its folder."""
    return any(
        path.name.lower() in _DEPTH_NAMES
        if path.is_dir()
        else path.name == tum_frames.DEPTH_LIST or _names_depth(path)
        for path in folder.rglob("*")
    )


def _names_depth(path: Path) -> bool:
    match = _SUFFIX.fullmatch(path.stem)
    return match is not None and match[2].lower() == "depth" and path.suffix.lower() in _DEPTH_FILES


def pairs_in(folder: Path, *, raw: bool = False) -> tuple[PhotoFiles, ...]:
    """Every pair below folder, by its path; BadInput without one, and for a lone half.

    raw: SUN RGB-D's measured depth rather than its filled one.
    """
    depth_names = sorted(_DEPTH_NAMES) if raw else _DEPTH_NAMES
    if not folder.is_dir():
        raise BadInput(folder, "", "no such folder")
    pairs: list[PhotoFiles] = []
    for inner in sorted({folder, *(p for p in folder.rglob("*") if p.is_dir())}):
        # Lists of times and files pair the pictures of two unsynchronised cameras (TUM RGB-D).
        if tum_frames.is_sequence(inner):
            place = inner.relative_to(folder)
            pairs += [
                PhotoFiles((place / rgb.stem).as_posix(), rgb, depth, tum_frames.DEPTH_SCALE)
                for rgb, depth in tum_frames.frames_of(inner)
            ]
            continue
        # Look for a colour folder beside a depth folder.
        names = {p.name.lower(): p for p in inner.iterdir() if p.is_dir()}
        rgb = next((names[n] for n in _RGB_NAMES if n in names), None)
        depth = next((names[n] for n in depth_names if n in names), None)
        if rgb is not None and depth is not None:
            pairs += _pairs_of_folders(folder, inner, rgb, depth)
        # Look for pairs by suffix anywhere else.
        if inner.name.lower() not in (*_RGB_NAMES, *_DEPTH_NAMES):
            pairs += _pairs_by_suffix(folder, inner)
    if not pairs:
        hint = "rgb/NAME.jpg with depth/NAME.png; see docs"
        raise BadInput(folder, "", "has no RGB-D pairs", hint=hint)
    return tuple(sorted(pairs, key=lambda pair: pair.id))


def _pairs_of_folders(root: Path, inner: Path, rgb: Path, depth: Path) -> list[PhotoFiles]:
    pictures, depths = _photograph_files(rgb, _RGB_FILES), _photograph_files(depth, _DEPTH_FILES)
    # Pair the only files of two folders regardless of their names (SUN RGB-D).
    if len(pictures) == len(depths) == 1 and pictures.keys() != depths.keys():
        (picture,), (depth_file,) = pictures.values(), depths.values()
        return [PhotoFiles(inner.relative_to(root).as_posix(), picture, depth_file)]
    # Name the first file without its other half.
    for name, path in (pictures | depths).items():
        if name not in pictures or name not in depths:
            lacks = "depth" if name in pictures else "colour"
            where = depth if name in pictures else rgb
            raise BadInput(path, "", f"only one half of a pair: {where} has no {lacks} {name}")
    place = inner.relative_to(root)
    return [PhotoFiles((place / n).as_posix(), pictures[n], depths[n]) for n in pictures]


def _photograph_files(folder: Path, endings: tuple[str, ...]) -> dict[str, Path]:
    # Index pictures by their name without ending.
    files: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.is_file() and path.suffix.lower() in endings:
            if path.stem in files:
                raise BadInput(path, "", f"two files are named {path.stem}")
            files[path.stem] = path
    return files


def _pairs_by_suffix(root: Path, inner: Path) -> list[PhotoFiles]:
    # Gather the halves of each name.
    halves: dict[str, dict[str, Path]] = {}  # name -> "rgb", "depth" -> file
    plain: dict[str, Path] = {}  # name -> file without a suffix
    for path in sorted(p for p in inner.iterdir() if p.is_file()):
        match = _SUFFIX.fullmatch(path.stem)
        if match is None:
            # NAME.png is paired with NAME_depth.png if there is no NAME_rgb.
            if path.suffix.lower() in _RGB_FILES:
                plain[path.stem] = path
            continue
        kind = "depth" if match[2].lower() == "depth" else "rgb"
        if path.suffix.lower() in (_DEPTH_FILES if kind == "depth" else _RGB_FILES):
            halves.setdefault(match[1], {})[kind] = path
    pairs = []
    for name, halves_of_name in halves.items():
        if "rgb" not in halves_of_name and name in plain:
            halves_of_name["rgb"] = plain[name]
        if len(halves_of_name) != 2:
            (kind, path), *_ = halves_of_name.items()
            lacks = "rgb" if kind == "depth" else "depth"
            raise BadInput(path, "", f"only one half of a pair: no {lacks}")
        place = (inner.relative_to(root) / name).as_posix()
        pairs.append(PhotoFiles(place, halves_of_name["rgb"], halves_of_name["depth"]))
    return pairs


def photo_from_pair(pair: PhotoFiles, *, depth_scale: float | None, sun_rgbd: bool) -> Photo:
    """Read the photograph of two files; raises BadInput naming the invalid file.

    depth_scale: depth units per metre; None = the layout's, else 1000 for integers, 1 for .npy and .exr. A picture
    with the aspect ratio of its depth but another size is resized to the depth's (as in ScanNet).
    """
    rgb = images.decode_photo(read_given(pair.rgb), str(pair.rgb))
    stored = stored_depth(pair.depth)
    if stored.ndim != 2:
        raise BadInput(pair.depth, "", f"expected one channel of depth, got {stored.shape}")
    if stored.shape != rgb.shape[:2] and is_same_form(stored.shape, rgb.shape):
        rgb = resized_by_area(rgb, stored.shape[1], stored.shape[0])
    if stored.shape != rgb.shape[:2]:
        sizes = f"{stored.shape[1]}x{stored.shape[0]}, the picture {rgb.shape[1]}x{rgb.shape[0]}"
        raise BadInput(pair.depth, "", f"sizes differ: depth is {sizes}")
    # Convert depth to whole millimetres.
    if sun_rgbd:
        if stored.dtype != np.uint16:
            raise BadInput(pair.depth, "", "expected 16 bits, as in SUN RGB-D")
        stored = sun_rgbd_depth(stored)
    is_float = np.issubdtype(stored.dtype, np.floating)
    scale = depth_scale or pair.depth_scale or (1.0 if is_float else 1000.0)
    return Photo(pair.id, rgb, _depth_mm(stored, scale, str(pair.depth), ""))


def is_same_form(one: tuple[int, ...], other: tuple[int, ...]) -> bool:
    """True if two pictures, (H, W, ...) each, have the same aspect ratio within 2 %.

    Example:
        >>> is_same_form((480, 640), (968, 1296, 3))
        True
    """
    across, down = one[1] * other[0], one[0] * other[1]
    return abs(across - down) <= _SAME_FORM * down


def stored_depth(path: Path) -> NDArray[Any]:
    if path.suffix.lower() == ".png":
        return images.array_from_png(read_given(path), str(path))
    if path.suffix.lower() == ".exr":
        layers = images.layers_from_exr(read_given(path), str(path))
        return layers.get("Z", next(iter(layers.values())))
    try:
        depth = np.load(io.BytesIO(read_given(path)), allow_pickle=False)
        if not isinstance(depth, np.ndarray):
            raise ValueError("an archive of arrays")
        return depth
    except (ValueError, EOFError):
        with naming_kind(path):
            raise BadInput(path, "", "cannot be read as a numpy array") from None


def _depth_mm(depth: NDArray[Any], scale: float, file: str, place: str) -> NDArray[np.uint16]:
    try:
        return depth_mm_from_units(depth, scale)
    except ValueError as error:
        raise BadInput(file, place, str(error)) from None


def h5py_for_mats() -> Any:
    """The module h5py, which reads MATLAB 7.3's files; MachineFailed with the install command if it is missing."""
    try:
        import h5py
    except ImportError:
        hint = install_command("selection")
        raise MachineFailed("h5py is needed for .mat files", hint=hint) from None
    return h5py


class NyuMat:
    """NYUv2's nyu_depth_v2_labeled.mat, read lazily: the file is 2.8 GB.

    MATLAB 7.3 is HDF5 with the axes reversed: images (n, 3, 640, 480) uint8 and depths
    (n, 640, 480) metres, or with `raw` rawDepths, without filled holes, if the file has them. Use as
    a context manager. Raises BadInput for a truncated file, another MATLAB version, or a file without
    these two arrays.
    """

    def __init__(self, path: Path, *, raw: bool = False) -> None:
        h5py = h5py_for_mats()
        self.path = path
        try:
            # Refuse a pipe or a device, on which a library would block.
            with open_regular(path, MAX_DIGEST_BYTES):
                pass
        except OSError as error:
            raise BadInput(path, "", fault_of(error)) from None
        try:
            self._file = h5py.File(path, "r")
        except OSError as error:
            raise BadInput(path, "", self._open_fault(str(error))) from None
        try:
            self._images, self._depths = self._tables(h5py)
            self.is_raw = raw and "rawDepths" in self._file
            self._stored = self._file["rawDepths"] if self.is_raw else self._depths
        except BadInput:
            self._file.close()
            raise

    def _open_fault(self, text: str) -> str:
        # Recognise common mistakes by the first bytes.
        with open_regular(self.path, MAX_DIGEST_BYTES) as file:
            start = file.read(10)
        if start.startswith(b"MATLAB 5.0"):
            return "a MATLAB 5 file; nyu_depth_v2_labeled.mat is of version 7.3"
        if "truncated" in text:
            return "the file is truncated; download it again"
        return "not a MATLAB 7.3 (HDF5) file, or damaged"

    def _tables(self, h5py: Any) -> tuple[Any, Any]:
        pictures, depths = self._file.get("images"), self._file.get("depths")
        # HDF5 shows MATLAB's arrays with their axes reversed: (n, 3, w, h) and (n, w, h).
        for name, table, n_axes in (("images", pictures, 4), ("depths", depths, 3)):
            if not isinstance(table, h5py.Dataset):
                raise BadInput(self.path, name, "missing; is this nyu_depth_v2_labeled.mat?")
            if table.ndim != n_axes:
                raise BadInput(self.path, name, f"expected {n_axes} axes, got {table.shape}")
        if pictures.dtype != np.uint8 or pictures.shape[1] != 3:
            raise BadInput(self.path, "images", f"expected (n, 3, w, h) uint8, got {pictures}")
        if (pictures.shape[0], *pictures.shape[2:]) != depths.shape:
            text = f"sizes differ: images {pictures.shape}, depths {depths.shape}"
            raise BadInput(self.path, "depths", text)
        return pictures, depths

    def __enter__(self) -> NyuMat:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def __len__(self) -> int:
        return int(self._depths.shape[0])

    def photos(self, numbers: Collection[int] | None = None) -> Iterator[Photo]:
        """The photographs (all, or those numbers from 1) in order, depth in whole mm; BadInput if damaged."""
        chosen = range(1, len(self) + 1) if numbers is None else sorted(numbers)
        for k in (number - 1 for number in chosen if number <= len(self)):
            place = f"image {k + 1}"
            try:
                # Transpose MATLAB's (channel, column, row).
                rgb = np.ascontiguousarray(np.asarray(self._images[k]).transpose(2, 1, 0))
                depth = np.asarray(self._stored[k]).T
                room = self._room(k)
            except (OSError, RuntimeError, ValueError, IndexError):
                raise BadInput(self.path, place, "cannot be read; the file is damaged") from None
            yield Photo(f"{k + 1:04d}", rgb, _depth_mm(depth, 1.0, str(self.path), place), room)

    def _room(self, k: int) -> str:
        """Name of the scene of a picture without the letter of its part, kitchen_0004; "" if unnamed."""
        if "scenes" not in self._file:
            return ""
        letters = np.asarray(self._file[self._file["scenes"][0, k]]).ravel()
        return "".join(map(chr, letters)).rstrip("abcdefgh")


def sha256_of_files(paths: list[Path]) -> str:
    """sha256 over the files' digests in order; a single file's own digest. BadInput if unreadable."""
    digests = []
    for path in paths:
        try:
            digests.append(digest_of_regular(path))
        except OSError as error:
            raise BadInput(path, "", fault_of(error)) from None
    return digests[0] if len(digests) == 1 else keys.sha256("".join(digests).encode())
