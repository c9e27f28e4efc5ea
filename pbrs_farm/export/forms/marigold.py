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

from collections import Counter
from pathlib import Path
from typing import Final

import numpy as np

from pbrs_farm.export.chosen_view import Choice, ChosenView
from pbrs_farm.export.content import Content, Files, Line, write_files
from pbrs_farm.export.form import PICTURES, REMARKS, Convention, ViewForm
from pbrs_farm.export.intrinsic_parts import intrinsic_layers, material_planes, opaque_pixels
from pbrs_farm.images import exr_from_layers

_LISTS: Final = (
    "filename_list", "filename_list_normals", "filename_list_iid_lighting", "filename_list_iid_appearance",
)  # fmt: skip


def write_marigold(views: list[ChosenView], out: Path, _choice: Choice) -> None:
    """Write the files above.

    A line is a sample; its paths are relative to the list's folder. Depth is uint16 PNG, mm along the axis,
    0 = nothing or 65.535 m and more. Normals are float32 (H, W, 3), unit, x right, y up, z towards the
    camera, 0 for nothing; a view without `normal` is in the list of depth alone. A view with `albedo`,
    `shading` and `residual` is a sample of light, like Marigold's of Hypersim: float32 (H, W, 3), linear,
    as the layers are; remarks.txt counts pixels with a negative residual, which its loader clips to 0. One with `albedo`, `roughness` and `metallic` is a sample of materials, like Marigold's of
    InteriorVerse. left_out.txt names views without a picture; BadInput if no view has one.
    """
    pixels: Counter[str] = Counter()
    write_files(out, (_files(view, pixels) for view in views))
    n_negative, n_pixels = pixels["negative"], pixels["all"]
    if n_negative:
        (out / REMARKS).write_text(
            f"residual: negative at {n_negative} of {n_pixels} pixels ({n_negative / n_pixels:.0%}), where a coat"
            " keeps light from the colour below it, and at edges; Marigold's loader clips it to 0\n"
        )


def _files(view: ChosenView, pixels: Counter[str]) -> Files:
    """The files of a view, and its line in each list; counts pixels with light, all and those below 0."""
    samples: dict[str, dict[str, Content]] = {_LISTS[0]: {"depth.png": view.depth_mm}}
    if view.has("normal"):
        samples[_LISTS[1]] = {"normal.npy": view.opengl_normals()}
    light = intrinsic_layers(view)
    if light is not None:
        parts = ("albedo.npy", "shading.npy", "residual.npy")
        samples[_LISTS[2]] = dict(zip(parts, light, strict=True))
        is_negative = (light[2] < 0).any(-1)
        pixels.update(negative=int(is_negative.sum()), all=is_negative.size)
    if all(map(view.has, ("albedo", "roughness", "metallic", "valid"))):
        # albedo is sRGB, material linear: R roughness, G metallic, B 0.
        samples[_LISTS[3]] = {
            "albedo.png": view.data("albedo"),
            "material.exr": exr_from_layers(material_planes(view), half=True),
            "mask.png": np.where(
                opaque_pixels(view)[..., None], np.uint8(255), np.zeros(3, np.uint8)
            ),
        }

    def place(part: str) -> str:
        kind, suffix = part.split(".")
        return f"{view.house.id}/{kind}_{view.id}.{suffix}"

    files: dict[str, Content] = {place("rgb.png"): view.shown}
    for name, contents in samples.items():
        placed = {place(part): content for part, content in contents.items()}
        files |= placed | {f"{name}.txt": Line(" ".join((place("rgb.png"), *placed)))}
    return files


def name_lists_by_split(out: Path, splits: tuple[str, ...], _choice: Choice) -> None:
    """Rename the lists of each split, as Marigold's own preparation does."""
    for split in splits:
        for name in _LISTS:
            file = out / split / f"{name}.txt"
            if file.is_file():
                file.rename(file.with_name(f"{name}_{split}.txt"))


FORM = ViewForm(
    "marigold",
    write_marigold,
    "`<house>/rgb_<view>.png`, `depth_<view>.png` (uint16 mm), `normal_<view>.npy`, intrinsic parts, and lists of them;"
    " with `--split` `train/filename_list_train.txt`",
    finish=name_lists_by_split,
    takes=PICTURES,
    lenses=("pinhole", "radtan", "opencv"),
    convention=Convention(None, axes="OpenGL's", depth="mm, along the axis"),
)
