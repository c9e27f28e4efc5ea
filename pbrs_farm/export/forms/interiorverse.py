"""InteriorVerse's layout, from which networks of materials train (jingsenzhu/IndoorInverseRendering).

    <house>/<3 digits>_{im,albedo,material,normal,depth,mask}.exr
    train.txt, val.txt, test.txt; index.csv

Effects: reads views, writes files.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.core.frames import linear_from_srgb
from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Files, Line, rgb_planes, write_files
from pbrs_farm.export.form import Convention, ViewForm, with_parts
from pbrs_farm.export.intrinsic_parts import material_planes, opaque_pixels, picture_radiance

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
    numbers: dict[str, int] = {}
    tables = (_files(view, numbers) for view in views)
    write_files(out, tables, {_INDEX: Line("scene,image,house,view")})


def _files(view: ChosenView, numbers: dict[str, int]) -> Files:
    scene = view.house.id.replace(_WORD, "-im")
    number = numbers[scene] = numbers.get(scene, -1) + 1
    depth_m = view.depth_m
    millimetres = np.where(depth_m > 0, depth_m * 1000, np.inf).astype(np.float32)
    images: dict[str, Mapping[str, F32]] = {
        "im": rgb_planes(_exposed_light(view)),
        "albedo": rgb_planes(linear_from_srgb(view.array("albedo") / 255).astype(np.float32)),
        "material": material_planes(view),
        "normal": rgb_planes(view.opengl_normals()),
        "depth": dict.fromkeys("RGB", millimetres),
        "mask": {"Y": opaque_pixels(view).astype(np.float32)},
    }
    files = {f"{scene}/{number:03d}_{name}.exr": planes for name, planes in images.items()}
    return {**files, _INDEX: Line(f"{scene},{number:03d},{view.house.id},{view.id}")}


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
    takes=with_parts("materials", *_LAYERS, hint=f"run with --layers {' '.join(_LAYERS[:3])}"),
    lenses=("pinhole",),
    layers=("roughness",),
    reads_radiance=True,
    convention=Convention(None, axes="OpenGL's", depth="mm, along the axis"),
)
