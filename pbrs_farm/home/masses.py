"""What a part of a thing weighs, by what it is made of; no effects.

Densities are those of handbooks: chipboard 650 kg/m3 (EN 312 has 600 to 700), glass 2,500 (EN 572),
steel 7,850, of sheets that are folded round air or foam 8 kg/m2 (1 mm).
"""

from __future__ import annotations

from typing import Final

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.core.mesh import face_areas, signed_volume

_BOARD_KG_M3: Final = 650.0
_GLASS_KG_M3: Final = 2_500.0
_STEEL_KG_M3: Final = 7_850.0
_SHEET_KG_M2: Final = 8.0
_GLASSY: Final = (MaterialKind.GLASS, MaterialKind.PANE, MaterialKind.MIRROR)
_SHEETS: Final = ("enamel", "steel", "chrome", "brass", "iron", "metal", "handle", "machine")


def mass_kg(corners: F64, material: Material) -> float:
    """Kilograms of one closed solid (F, 3, 3) of a material, metres.

    Metal and enamel weigh as solid steel or as its sheet, whichever is less. A mesh that is open has
    no volume: it counts for what its triangles bound with their middle.
    """
    if not len(corners):
        return 0.0
    volume = abs(signed_volume(corners, corners.mean((0, 1))))
    name = material.name.casefold()
    if material.kind in _GLASSY or "glass" in name:
        return _GLASS_KG_M3 * volume
    if material.is_metal or any(word in name for word in _SHEETS):
        area = float(face_areas(corners).sum())
        return min(_STEEL_KG_M3 * volume, _SHEET_KG_M2 * area)
    return _BOARD_KG_M3 * volume
