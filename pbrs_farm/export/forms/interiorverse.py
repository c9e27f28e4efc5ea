"""InteriorVerse's layout, from which networks of materials train (jingsenzhu/IndoorInverseRendering).

    <house>/<3 digits>_{im,albedo,material,normal,depth,mask}.exr
    train.txt, val.txt, test.txt; index.csv

Effects: reads views, writes files.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_metres,
    opengl_normals,
    require_lens,
)
from pbrs_farm.export.form import Convention, ViewForm, name_left_out, write_file
from pbrs_farm.export.intrinsic_parts import material_planes, opaque_pixels, picture_radiance
from pbrs_farm.images import exr_from_layers

_INDEX: Final = "index.csv"  # not in InteriorVerse: the view of each number
_LAYERS: Final = ("albedo", "roughness", "metallic", "normal")
_WORD: Final = "_im"  # its loaders replace it everywhere in a path by the name of the layer


def write_interiorverse(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the EXR files above, float32.

    im is the radiance that the picture developed, times its white balance and exposure, so that clipped to 0..1
    it is a picture; without radiance.exr, or of OpenGL, the picture in linear colours. albedo is linear. material:
    R roughness, G metallic. normal: OpenGL's camera axes. depth: mm along the axis, three times, infinite without a
    surface. mask: 1 = a surface, but no glass or mirror if the views have these layers. A house's name
    has "-im" for "_im". left_out.txt names views without the layers; BadInput if none has them.
    """
    chosen = [view for view in views if view.picture is not None and all(map(view.has, _LAYERS))]
    if not chosen:
        hint = f"run with --layers {' '.join(_LAYERS[:3])}"
        raise BadInput("--to", "interiorverse", "no view has a picture and materials", hint=hint)
    numbers: dict[str, int] = {}
    rows = ["scene,image,house,view\n"]
    for view in chosen:
        require_lens(view, "interiorverse", *FORM.lenses)
        scene = view.house.id.replace(_WORD, "-im")
        number = numbers[scene] = numbers.get(scene, -1) + 1
        for name, planes in _images(view):
            write_file(out / scene / f"{number:03d}_{name}.exr", exr_from_layers(planes))
        rows.append(f"{scene},{number:03d},{view.house.id},{view.id}\n")
    (out / _INDEX).write_text("".join(rows), "utf-8")
    name_left_out(out, [v for v in views if v not in chosen], "has no picture or no materials")


def _images(view: ChosenView) -> Iterator[tuple[str, dict[str, F32]]]:
    """The name and the channels of each file of a view."""
    yield "im", _rgb(_exposed_light(view))
    yield "albedo", _rgb(linear_from_srgb(view.array("albedo") / 255).astype(np.float32))
    yield "material", material_planes(view)
    yield "normal", _rgb(opengl_normals(view))
    metres = depth_metres(view)
    millimetres = np.where(metres > 0, metres * 1000, np.inf).astype(np.float32)
    yield "depth", dict.fromkeys("RGB", millimetres)
    yield "mask", {"Y": opaque_pixels(view).astype(np.float32)}


def _rgb(image: F32) -> dict[str, F32]:
    return dict(zip("RGB", np.moveaxis(image, -1, 0), strict=True))


def _exposed_light(view: ChosenView) -> F32:
    """(H, W, 3) linear light of the picture, as exposed for it."""
    mode = view.picture or ""
    facts = view.facts.get("modes", {}).get("develop", {}).get(mode)
    light = None if facts is None else picture_radiance(view)
    if light is None or facts is None:
        return linear_from_srgb(view.array(mode)[..., :3] / 255).astype(np.float32)
    return np.asarray(light * np.array(facts["gains"]) * facts["exposure"], np.float32)


def join_lists(out: Path, splits: tuple[str, ...], _choice: Choice) -> None:
    """Write the list of each split's scenes; without splits all are of train."""
    for split in splits or ("",):
        scenes = sorted(path.name for path in (out / split).iterdir() if path.is_dir())
        lines = [f"{split}/{scene}\n".lstrip("/") for scene in scenes]
        (out / f"{split or 'train'}.txt").write_text("".join(lines), "utf-8")


FORM = ViewForm(
    "interiorverse",
    write_interiorverse,
    "InteriorVerse: `<house>/<3 digits>_im.exr`, `_albedo`, `_material`, `_normal`, `_depth`, `_mask`; `train.txt`, `index.csv`",
    finish=join_lists,
    lenses=("pinhole",),
    layers=("roughness",),
    reads_radiance=True,
    convention=Convention(None, axes="OpenGL's", depth="mm, along the axis"),
)
