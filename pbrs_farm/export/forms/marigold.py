"""List files of pictures, depth, normals and intrinsic parts, as Marigold and those that follow it train from.

    <house>/rgb_<view>.png  depth_<view>.png  normal_<view>.npy
    filename_list[_<split>].txt          rgb depth
    filename_list_normals[_<split>].txt  rgb normal
    <house>/{albedo,shading,residual}_<view>.npy
    filename_list_iid_lighting[_<split>].txt     rgb albedo shading residual
    <house>/albedo_<view>.png  material_<view>.exr  mask_<view>.png
    filename_list_iid_appearance[_<split>].txt   rgb albedo material mask

Effects: reads views, writes files.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.core.arrays import F32
from pbrs_farm.export.chosen_view import (
    Choice,
    ChosenView,
    depth_within_png,
    opengl_normals,
    require_lens,
)
from pbrs_farm.export.form import REMARKS, Convention, ViewForm, name_left_out, views_with_picture
from pbrs_farm.export.intrinsic_parts import intrinsic_layers, material_planes, opaque_pixels
from pbrs_farm.images import exr_from_layers, png_from_array

_LISTS: Final = {
    "depth": "filename_list",
    "normal": "filename_list_normals",
    "lighting": "filename_list_iid_lighting",
    "appearance": "filename_list_iid_appearance",
}


def write_marigold(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above.

    A line is a sample; its paths are relative to the list's folder. Depth is uint16 PNG, mm along the axis,
    0 = nothing or 65.535 m and more. Normals are float32 (H, W, 3), unit, x right, y up, z towards the
    camera, 0 for nothing; a view without `normal` is in the list of depth alone. A view with `albedo`,
    `shading` and `residual` is a sample of light, like Marigold's of Hypersim: float32 (H, W, 3), linear,
    as the layers are; remarks.txt counts pixels with a negative residual, which its loader clips to 0. One with `albedo`, `roughness` and `metallic` is a sample of materials, like Marigold's of
    InteriorVerse. left_out.txt names views without a picture; BadInput if no view has one.
    """
    lines: dict[str, list[str]] = {name: [] for name in _LISTS}
    n_negative = n_pixels = 0
    for view in views_with_picture(views):
        require_lens(view, "marigold", *FORM.lenses)
        (out / view.house.id).mkdir(exist_ok=True)
        rgb = f"{view.house.id}/rgb_{view.id}.png"
        (out / rgb).write_bytes(view.data(view.picture or ""))
        depth = f"{view.house.id}/depth_{view.id}.png"
        (out / depth).write_bytes(png_from_array(depth_within_png(view)))
        lines["depth"].append(f"{rgb} {depth}\n")
        if view.has("normal"):
            normal = f"{view.house.id}/normal_{view.id}.npy"
            np.save(out / normal, opengl_normals(view))
            lines["normal"].append(f"{rgb} {normal}\n")
        light = intrinsic_layers(view)
        if light is not None:
            lines["lighting"].append(f"{' '.join((rgb, *_write_lighting(view, light, out)))}\n")
            is_negative = (light[2] < 0).any(-1)
            n_negative, n_pixels = n_negative + int(is_negative.sum()), n_pixels + is_negative.size
        files = _write_appearance(view, out)
        if files:
            lines["appearance"].append(f"{' '.join((rgb, *files))}\n")
    for name, samples in lines.items():
        if samples:
            (out / f"{_LISTS[name]}.txt").write_text("".join(samples), "utf-8")
    if n_negative:
        (out / REMARKS).write_text(
            f"residual: negative at {n_negative} of {n_pixels} pixels ({n_negative / n_pixels:.0%}), where a coat"
            " keeps light from the colour below it, and at edges; Marigold's loader clips it to 0\n"
        )
    without = [view for view in views if view.picture is None]
    name_left_out(out, without, "has no picture")


def _write_lighting(view: ChosenView, light: tuple[F32, F32, F32], out: Path) -> list[str]:
    """Write albedo, shading and residual; returns their paths."""
    files = [f"{view.house.id}/{n}_{view.id}.npy" for n in ("albedo", "shading", "residual")]
    for file, part in zip(files, light, strict=True):
        np.save(out / file, part)
    return files


def _write_appearance(view: ChosenView, out: Path) -> list[str]:
    """Write albedo (sRGB), material (linear; R roughness, G metallic, B 0) and the mask of valid pixels."""
    if not all(view.has(name) for name in ("albedo", "roughness", "metallic", "valid")):
        return []
    parts = "albedo_{}.png", "material_{}.exr", "mask_{}.png"
    files = [f"{view.house.id}/{part.format(view.id)}" for part in parts]
    (out / files[0]).write_bytes(view.data("albedo"))
    (out / files[1]).write_bytes(exr_from_layers(material_planes(view), half=True))
    mask = np.where(opaque_pixels(view)[..., None], np.uint8(255), np.zeros(3, np.uint8))
    (out / files[2]).write_bytes(png_from_array(mask))
    return files


def name_lists_by_split(out: Path, splits: tuple[str, ...], _choice: Choice) -> None:
    """Rename the lists of each split, as Marigold's own preparation does."""
    for split in splits:
        for name in _LISTS.values():
            file = out / split / f"{name}.txt"
            if file.is_file():
                file.rename(file.with_name(f"{name}_{split}.txt"))


FORM = ViewForm(
    "marigold",
    write_marigold,
    "`<house>/rgb_<view>.png`, `depth_<view>.png` (uint16 mm), `normal_<view>.npy`, intrinsic parts, and lists of them;"
    " with `--split` `train/filename_list_train.txt`",
    finish=name_lists_by_split,
    lenses=("pinhole", "radtan", "opencv"),
    convention=Convention(None, axes="OpenGL's", depth="mm, along the axis"),
)
