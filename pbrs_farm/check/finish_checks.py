"""Gloss of surfaces as house.json and house.glb say it: roughness, reflectance at right angles, metal; no effects.

Formulas are written again here from docs/formats/pixels.md and the sources it names; the stages' code is not used.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import decode_texture

Floats = NDArray[np.float64]

_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
_CLEAR: Final = ("mirror", "glass", "pane")  # kinds without roughness
_MAPPED: Final = ("opaque", "shade")  # kinds whose roughness map shows
_LEAST_ALPHA: Final = 0.05
_DIELECTRIC: Final = 0.04  # of index 1.5, at right angles
_LEAST_METAL: Final = 0.2  # luminance of Ks
_WHITEST: Final = 0.9  # of Kd beside Ks


@dataclass(frozen=True, slots=True, eq=False)
class Finishes:
    """The gloss of a house's M materials, maps decoded when one is looked up."""

    rows: tuple[Mapping[str, Any], ...]  # of house.json
    pictures: tuple[tuple[str, bytes] | None, ...]  # roughness map of each: media type and bytes
    decoded: dict[int, NDArray[np.uint8] | None] = field(default_factory=dict)

    def kinds(self) -> tuple[str, ...]:
        """The kind of each material."""
        return tuple(str(row["kind"]) for row in self.rows)

    def green(self, material: int) -> NDArray[np.uint8] | None:
        """(H, W, 1) bytes of a material's roughness map; None where it has none that shows."""
        stored = self.pictures[material] if material < len(self.pictures) else None
        if stored is None or self.rows[material]["kind"] not in _MAPPED:
            return None
        if material not in self.decoded:
            try:
                found = decode_texture(stored[1], f"material {material}", stored[0])
                flat = found[..., None] if found.ndim == 2 else found[..., 1:2]
                self.decoded[material] = flat
            except BadInput:
                self.decoded[material] = None  # counts as white
        return self.decoded[material]

    def alpha(self) -> Floats:
        """(M,) GGX roughness without maps: 0 of what is smooth, 1 of what is matte."""
        return np.array([self._alpha(row) for row in self.rows])

    def f0(self) -> Floats:
        """(M, 3) linear reflectance at right angles, 0 of what is matte."""
        return np.array([_f0(row) for row in self.rows]).reshape(-1, 3)

    def is_metal(self) -> NDArray[np.bool_]:
        """(M,) whether it is a metal or a mirror."""
        glossy = [_has_coat(r) and r["kind"] not in _CLEAR and _is_metal(r) for r in self.rows]
        return np.array(
            [g or r["kind"] == "mirror" for g, r in zip(glossy, self.rows, strict=True)]
        )

    def _alpha(self, row: Mapping[str, Any]) -> float:
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
    if row["kind"] == "shade":
        return False
    is_named = row["roughness"] is not None or row["roughness_texture_id"] is not None
    return is_named or (row["shininess"] > 1 and max(row["specular"]) > 0)


def _is_metal(row: Mapping[str, Any]) -> bool:
    kd, ks = (float(_linear(row[name]) @ _LUMINANCE) for name in ("diffuse", "specular"))
    return row["texture_id"] is None and ks > _LEAST_METAL and 4 * kd < ks


def _f0(row: Mapping[str, Any]) -> Floats:
    kd, ks = _linear(row["diffuse"]), _linear(row["specular"])
    if row["kind"] == "mirror":
        return np.minimum(ks if ks @ _LUMINANCE > 0.3 else 0.9, 0.98) * np.ones(3)
    if row["kind"] in _CLEAR:
        return np.full(3, _DIELECTRIC)
    if not _has_coat(row):
        return np.zeros(3)
    if _is_metal(row):
        return np.asarray(ks / max(float((np.minimum(kd, _WHITEST) + ks).max()), 1))
    is_named = row["roughness"] is not None or row["roughness_texture_id"] is not None
    coat = 0.08 * np.clip(np.array(row["specular"], np.float64), 0, 1)
    return np.maximum(coat, _DIELECTRIC if is_named else 0)


def _linear(srgb: Any) -> Floats:
    c = np.clip(np.array(srgb, np.float64), 0, 1)
    return np.asarray(np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4))
