"""A folder a picture, with logarithmic depth, as MoGe-2 trains from it (microsoft/MoGe, its page on training).

    .index.txt
    <house>/<view>/{image.jpg,depth.png,normal.png,meta.json}

Effects: reads views, writes files.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F64, Bools
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_metres,
    opengl_normals_png,
    require_lens,
)
from pbrs_farm.export.form import Convention, ViewForm, name_left_out, views_with_picture
from pbrs_farm.images import jpeg_from_array, png_from_array

_INDEX: Final = ".index.txt"
_QUALITY: Final = 95  # of JPEG, as its own writer
_FIRST: Final = 1  # value of the nearest depth
_LAST: Final = 65534  # value of the farthest depth
_INFINITE: Final = 65535  # value of the sky; 0 is unknown
_LEAST_RATIO: Final = 1.1  # of far to near


def write_moge(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above.

    .index.txt lists the folders, a line each. depth.png is 16 bit: near^(1 - t) far^t metres along the axis with
    t = (value - 1) / 65533, near and far in its text; 0 is unknown (beyond 65.535 m without `depth_z`), 65535 is
    infinite (nothing was hit). normal.png is 16 bit, (n + 1) / 2 in OpenGL's axes, 0 for nothing. meta.json has
    K over the picture's size. left_out.txt names views without a picture; BadInput if no view has one.
    """
    folders: list[str] = []
    for view in views_with_picture(views):
        require_lens(view, "moge", *FORM.lenses)
        folder = f"{view.house.id}/{view.id}"
        (out / folder).mkdir(parents=True)
        picture = jpeg_from_array(view.array(view.picture or ""), _QUALITY)
        (out / folder / "image.jpg").write_bytes(picture)
        (out / folder / "depth.png").write_bytes(logarithmic_png(depth_metres(view), _is_sky(view)))
        if view.has("normal"):
            (out / folder / "normal.png").write_bytes(png_from_array(opengl_normals_png(view)))
        size = np.array([[view.facts["width_px"]], [view.facts["height_px"]], [1.0]])
        meta = {"intrinsics": (np.array(view.facts["K"], np.float64) / size).tolist()}
        (out / folder / "meta.json").write_text(json.dumps(meta), "utf-8")
        folders.append(f"{folder}\n")
    (out / _INDEX).write_text("".join(folders), "utf-8")
    name_left_out(out, [view for view in views if view.picture is None], "has no picture")


def _is_sky(view: ChosenView) -> Bools:
    """(H, W) pixels whose ray hits nothing."""
    return np.asarray(view.array("depth") == 0)


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
    write_moge,
    "MoGe-2: `.index.txt`, `<house>/<view>/` with `image.jpg`, `depth.png`, `normal.png`, `meta.json`",
    lenses=("pinhole",),
    convention=Convention(0.5, axes="OpenGL's", depth="logarithmic, along the axis"),
)
