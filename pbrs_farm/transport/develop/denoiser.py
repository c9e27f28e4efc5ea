"""Denoising by Open Image Denoise.

Effects: the denoiser's threads, and its device and filter, which `pyoidn.denoise` keeps for the
life of the process (since 2.5.1): only the first picture pays 0.2 s for them. Pictures use its best
network (`quality` high): a cheaper one saves less CPU than the samples it would take to make up for.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from pbrs_farm.core.arrays import RadianceImage, UnitVectors
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.installation import install_command
from pbrs_farm.transport.light_result import LightResult


def denoise(result: LightResult) -> LightResult:
    """Denoise each light group separately, guided by albedo and normal, so that modes stay exact sums.

    The light of single lamps (`lamps`) is not denoised.
    """
    return replace(
        result,
        outdoor=denoise_radiance(result.outdoor, result.albedo, result.normal),
        indoor=denoise_radiance(result.indoor, result.albedo, result.normal),
    )


def denoise_radiance(
    radiance: RadianceImage, albedo: RadianceImage, normal: UnitVectors, quality: str = "high"
) -> RadianceImage:
    """(H, W, 3) float32 denoised radiance, guided by noise-free albedo and normals.

    quality: of the network, "high" or "fast", which takes a fifth of the time.
    A black picture is returned unchanged. Raises MachineFailed if pyoidn is not installed.
    """
    if not np.any(radiance > 0):
        return radiance
    pyoidn = _pyoidn()
    # Albedo and normals are means of many rays: they need no denoising before they guide.
    images = (np.ascontiguousarray(a, np.float32) for a in (radiance, albedo, normal))
    clean = pyoidn.denoise(*images, hdr=True, clean_aux=True, quality=quality)
    # Remove what the network may invent: negative and non-finite values.
    return np.maximum(np.nan_to_num(np.asarray(clean, np.float32), posinf=0.0), 0.0)


def _pyoidn() -> Any:
    """The binding of the denoiser; MachineFailed when it cannot be imported."""
    try:
        # pyoidn would import torch for tensors never passed here: a second and 200 MB.
        with _hidden("torch"):
            import pyoidn
    except ImportError as error:
        text = f"the denoiser cannot be loaded: {error}"
        raise MachineFailed(text, hint=install_command()) from error
    return pyoidn


@contextmanager
def _hidden(package: str) -> Iterator[None]:
    """A package that is not imported yet seems not to be installed."""
    if package in sys.modules:
        yield
        return
    sys.modules[package] = None  # type: ignore[assignment]  # what import takes for "not there"
    try:
        yield
    finally:
        del sys.modules[package]
