"""A folder a picture, with logarithmic depth, as MoGe-2 trains from it (microsoft/MoGe, its page on training).

    .index.txt
    <house>/<view>/{image.jpg,depth.png,normal.png,meta.json}

Effects: reads views, writes files.
"""

from __future__ import annotations

import json
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.export.chosen_view import ChosenView
from pbrs_farm.export.content import Content, Files, Line, each_view
from pbrs_farm.export.form import PICTURES, Convention, ViewForm
from pbrs_farm.images import png_from_array

_INDEX: Final = ".index.txt"
_FIRST: Final = 1  # value of the nearest depth
_LAST: Final = 65534  # value of the farthest depth
_INFINITE: Final = 65535  # value of the sky; 0 is unknown
_LEAST_RATIO: Final = 1.1  # of far to near


def files_of(view: ChosenView) -> Files:
    """The files above of a view.

    .index.txt lists the folders, a line each. depth.png is 16 bit: near^(1 - t) far^t metres along the axis with
    t = (value - 1) / 65533, near and far in its text; 0 is unknown (beyond 65.535 m without `depth_z`), 65535 is
    infinite (nothing was hit). normal.png is 16 bit, (n + 1) / 2 in OpenGL's axes, 0 for nothing. meta.json has
    K over the picture's size. left_out.txt names views without a picture; BadInput if no view has one.
    """
    folder, (width, height) = f"{view.house.id}/{view.id}", view.size
    k_over_size = np.array(view.facts["K"], np.float64) / [[width], [height], [1.0]]
    files: dict[str, Content] = {
        _INDEX: Line(folder),
        f"{folder}/image.jpg": view.colours,
        f"{folder}/depth.png": logarithmic_png(view.depth_m, view.array("depth") == 0),
        f"{folder}/meta.json": json.dumps({"intrinsics": k_over_size.tolist()}),
    }
    if view.has("normal"):
        files[f"{folder}/normal.png"] = view.opengl_normals_png
    return files


def logarithmic_png(metres: F64, is_infinite: Bools) -> bytes:
    """The PNG of a depth (H, W) in metres, 0 = unknown, with the texts `near` and `far`."""
    is_known = (metres > 0) & ~is_infinite
    known = metres[is_known].astype(np.float32)
    near = float(known.min()) if known.size else 1.0
    far = max(near * _LEAST_RATIO, float(known.max()) if known.size else near)
    share = np.log(np.where(is_known, metres, near) / near) / np.log(far / near)
    steps = _FIRST + np.rint(np.clip(share, 0, 1) * (_LAST - _FIRST))
    values = np.where(is_infinite, _INFINITE, np.where(is_known, steps, 0)).astype(np.uint16)
    return png_from_array(values, texts={"near": repr(near), "far": repr(far)})


FORM = ViewForm(
    "moge",
    each_view(files_of),
    "MoGe-2: `.index.txt`, `<house>/<view>/` with `image.jpg`, `depth.png`, `normal.png`, `meta.json`",
    takes=PICTURES,
    lenses=("pinhole",),
    convention=Convention(0.5, axes="OpenGL's", depth="logarithmic, along the axis"),
)
