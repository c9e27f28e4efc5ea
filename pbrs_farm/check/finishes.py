"""Gloss of surfaces by the formulas of docs/formats/pixels.md, without the stages' code; no effects."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbrs_farm.check.colours import LUMINANCE, linear_from_srgb
from pbrs_farm.core.arrays import F64, Bools

_CLEAR = ("mirror", "glass", "pane")  # kinds without roughness
_MAPPED = ("opaque", "shade")  # kinds whose roughness map has an effect
_LEAST_ALPHA = 0.05
_DIELECTRIC = 0.04  # reflectance of index 1.5 at normal incidence
_LEAST_METAL = 0.2  # luminance of Ks
_WHITEST = 0.9  # of Kd beside Ks


@dataclass(frozen=True, eq=False)
class Finishes:
    """The gloss of a house's M materials."""

    rows: tuple[Mapping[str, Any], ...] = ()  # of house.json

    @functools.cached_property
    def alpha(self) -> F64:
        """(M,) GGX roughness without maps: 0 = smooth, 1 = matte."""
        return np.array([_alpha(row) for row in self.rows])

    def is_mapped(self, material: int) -> bool:
        """True if a roughness map of the material has an effect."""
        return self.rows[material]["kind"] in _MAPPED

    @functools.cached_property
    def f0(self) -> F64:
        """(M, 3) linear reflectance at normal incidence, 0 of matte materials."""
        return np.array([_f0(row) for row in self.rows]).reshape(-1, 3)

    @functools.cached_property
    def is_metal(self) -> Bools:
        """(M,) metals and mirrors."""
        return np.array([r["kind"] == "mirror" or _is_metal(r) for r in self.rows], bool)


def mapped_alpha(alpha: F64, share: F64) -> F64:
    """(N,) GGX roughness times a roughness map's values 0..1."""
    return np.maximum(alpha * share**2, _LEAST_ALPHA)


def has_roughness(row: Mapping[str, Any]) -> bool:
    """True if house.json gives a material a roughness or a map of it."""
    return row["roughness"] is not None or row["roughness_texture_id"] is not None


def _alpha(row: Mapping[str, Any]) -> float:
    if row["kind"] in _CLEAR:
        return 0.0
    if not _has_coat(row):
        return 1.0
    if row["roughness"] is not None:
        return float(max(np.clip(row["roughness"], 0, 1) ** 2, _LEAST_ALPHA))
    if row["roughness_texture_id"] is not None:
        return 1.0
    return float(max(np.sqrt(2 / (min(row["shininess"], 1e4) + 2)), _LEAST_ALPHA))


def _has_coat(row: Mapping[str, Any]) -> bool:
    is_shiny = row["shininess"] > 1 and max(row["specular"]) > 0
    return row["kind"] != "shade" and (has_roughness(row) or is_shiny)


def has_metallic_colour(row: Mapping[str, Any]) -> bool:
    """True if highlights give a material its colour."""
    kd, ks = (linear_from_srgb(row[name]) @ LUMINANCE for name in ("diffuse", "specular"))
    return bool(row["texture_id"] is None and ks > _LEAST_METAL and 4 * kd < ks)


def _is_metal(row: Mapping[str, Any]) -> bool:
    return row["kind"] not in _CLEAR and _has_coat(row) and has_metallic_colour(row)


def _f0(row: Mapping[str, Any]) -> F64:
    kd, ks = linear_from_srgb(row["diffuse"]), linear_from_srgb(row["specular"])
    if row["kind"] == "mirror":
        return np.minimum(ks if ks @ LUMINANCE > 0.3 else 0.9, 0.98) * np.ones(3)
    if row["kind"] in _CLEAR:
        return np.full(3, _DIELECTRIC)
    if not _has_coat(row):
        return np.zeros(3)
    if has_metallic_colour(row):
        return np.asarray(ks / max(float((np.minimum(kd, _WHITEST) + ks).max()), 1))
    coat = 0.08 * np.clip(np.array(row["specular"], np.float64), 0, 1)
    return np.maximum(coat, _DIELECTRIC if has_roughness(row) else 0)
