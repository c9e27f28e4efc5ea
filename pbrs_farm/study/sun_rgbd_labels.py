"""Classes of SUN RGB-D's photographs from its toolbox. Effects: reads files.

SUNRGBDtoolbox/Metadata/SUNRGBD2Dseg.mat (MATLAB 7.3) has 37 classes, the first of NYU40; the row of a
scene is that of its rgbpath in SUNRGBDMeta.mat (MATLAB 5) beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.curate.photographs import h5py_for_mats

CLASSES: Final = "SUNRGBDtoolbox/Metadata/SUNRGBD2Dseg.mat"
"""File of the classes, in a folder above the scenes."""
_SCENES: Final = "SUNRGBDMeta.mat"
_N_CLASSES: Final = 37


def has_classes(scene: Path) -> bool:
    """True if a toolbox in a folder above has classes of the scene; BadInput for a damaged one."""
    return _file_and_row(scene) is not None


def classes_of_scene(scene: Path) -> NDArray[np.uint8]:
    """(H, W) NYU40 ids 0..37 of the scene's picture, 0 = none; BadInput if they are missing or damaged."""
    file_and_row = _file_and_row(scene)
    if file_and_row is None:
        raise BadInput(scene, "", f"no classes of this scene in {CLASSES} above it")
    path, row = file_and_row
    h5py = h5py_for_mats()
    try:
        with h5py.File(path, "r") as file:
            # MATLAB's arrays have their axes reversed.
            stored = np.asarray(file[file["SUNRGBD2Dseg"]["seglabel"][row, 0]]).T
    except (OSError, RuntimeError, KeyError, IndexError, ValueError, TypeError):
        raise BadInput(path, f"seglabel, row {row + 1}", "cannot be read") from None
    is_table = stored.ndim == 2 and stored.size and stored.dtype.kind in "uif"
    if not is_table or not np.isin(stored, range(_N_CLASSES + 1)).all():
        text = f"expected (H, W) classes 0 to {_N_CLASSES}"
        raise BadInput(path, f"seglabel, row {row + 1}", text)
    return stored.astype(np.uint8)


def _file_and_row(scene: Path) -> tuple[Path, int] | None:
    """The file of classes above a scene, and the row of the scene; None without either."""
    scene = scene.absolute()
    path = next((p / CLASSES for p in scene.parents if (p / CLASSES).is_file()), None)
    if path is None:
        return None
    rows, parts = _rows_of_scenes(path.with_name(_SCENES)), scene.parts
    names = ("/".join(parts[k:]) for k in range(len(parts)))
    row = next((rows[name] for name in names if name in rows), None)
    return None if row is None else (path, row)


@lru_cache(maxsize=2)
def _rows_of_scenes(path: Path) -> Mapping[str, int]:
    """Row of each scene by its path below SUNRGBD, `kv1/NYUdata/NYU0001`."""
    from scipy.io import loadmat

    if not path.is_file():
        raise BadInput(path, "", "needed with SUNRGBD2Dseg.mat: it maps its rows to scenes")
    try:
        scenes = loadmat(path, squeeze_me=True, struct_as_record=False)["SUNRGBDMeta"]
        paths = [str(scene.rgbpath) for scene in np.atleast_1d(scenes)]
    except Exception:  # noqa: BLE001  scipy raises many kinds of errors for another file
        raise BadInput(path, "SUNRGBDMeta", "not the expected MATLAB 5 file") from None
    # Each is /n/fs/sun3d/data/SUNRGBD/<scene>/image/NAME.jpg.
    parts = [[part for part in path.split("/") if part] for path in paths]
    return {
        "/".join(p[p.index("SUNRGBD") + 1 : -2]): k for k, p in enumerate(parts) if "SUNRGBD" in p
    }
