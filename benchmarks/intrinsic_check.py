"""How far albedo x shading + residual is from the light of radiance.exr: files read and denoised by code of its own.

Nothing of the package is used: OpenImageIO, Pillow and h5py read what the forms say is there, and pyoidn
denoises as docs/light.md has it.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import OpenImageIO
import pyoidn
from numpy.typing import NDArray
from PIL import Image

_GROUPS = {"": ("outdoor", "indoor"), "_outdoor": ("outdoor",), "_indoor": ("indoor",)}


def intrinsic_errors(root: Path, hypersim: Path) -> dict[str, float]:
    """What is summed -> median over all values of all views of the error over the light.

    root: finished views with the layers; hypersim: the same views in Hypersim's layout.
    """
    found: dict[str, list[NDArray[Any]]] = {}
    for view in sorted(root.glob("houses/*/views/*")):
        light = _light(_channels(view / "radiance.exr"))
        srgb = np.asarray(Image.open(view / "albedo.png")) / 255.0
        albedo = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        for ending, groups in _GROUPS.items():
            shading, residual = (
                _rgb(_channels(view / f"{name}{ending}.exr")) for name in ("shading", "residual")
            )
            total = sum((light[group] for group in groups), np.zeros_like(albedo))
            errors = _errors(albedo * shading + residual, total)
            found.setdefault(f"all light{ending.replace('_', ': ')}", []).append(errors)
    found["hypersim"] = [_errors(total, colour) for total, colour in _hypersim(hypersim)]
    return {name: float(np.median(np.concatenate(rows))) for name, rows in found.items()}


def _errors(found: NDArray[Any], light: NDArray[Any]) -> NDArray[Any]:
    """(N,) relative errors where there is light."""
    lit = light > 0
    return np.asarray(np.abs(found[lit] - light[lit]) / light[lit])


def _channels(file: Path) -> dict[str, NDArray[Any]]:
    exr = OpenImageIO.ImageBuf(str(file))
    pixels = np.asarray(exr.get_pixels(OpenImageIO.FLOAT))
    return {name: pixels[..., k] for k, name in enumerate(exr.spec().channelnames)}


def _rgb(channels: dict[str, NDArray[Any]], prefix: str = "", letters: str = "RGB") -> NDArray[Any]:
    return np.ascontiguousarray(np.stack([channels[prefix + c] for c in letters], -1))


def _light(channels: dict[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Group of light -> its radiance, denoised by itself; 0 where nothing is seen."""
    albedo, normal = _rgb(channels, "albedo."), _rgb(channels, "normal.", "XYZ")
    raw = {group: _rgb(channels, f"{group}.") for group in ("outdoor", "indoor")}
    seen = ((raw["outdoor"] + raw["indoor"] > 0) | (albedo > 0)).any(-1, keepdims=True)
    clean = {}
    for group, image in raw.items():
        if image.any():
            image = np.asarray(pyoidn.denoise(image, albedo, normal, hdr=True, clean_aux=True))
        clean[group] = np.maximum(image, 0) * seen
    return clean


def _hypersim(folder: Path) -> Iterator[tuple[NDArray[Any], NDArray[Any]]]:
    """(reflectance x illumination + residual, color) of each frame."""
    for file in sorted(folder.glob("ai_*/images/*_final_hdf5/*.color.hdf5")):
        names = ("color", "diffuse_reflectance", "diffuse_illumination", "residual")
        colour, reflectance, illumination, residual = (
            np.asarray(h5py.File(str(file).replace(".color.", f".{name}."))["dataset"], np.float64)
            for name in names
        )
        yield reflectance * illumination + residual, colour
