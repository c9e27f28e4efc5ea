"""Which materials of a window or door are its glass though they say opaque; no effects."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from typing import Any, Final

from pbrs_farm.formats.glb import Gltf, entry
from pbrs_farm.read.gltf.document import object_at

# Words of names, accents folded: English, German, French, Spanish, Italian, Dutch, Swedish.
_GLASS: Final = frozenset(
    ("glass", "glazing", "pane", "windowpane", "windowglass", "glas", "scheibe", "verglasung",
     "fensterglas", "verre", "vitre", "vitrage", "vidrio", "cristal", "vetro", "ruit")
)  # fmt: skip
_WINDOW: Final = frozenset(
    ("window", "fenster", "fenetre", "ventana", "finestra", "raam", "fonster", "vindu")
)
_FRAME: Final = frozenset(
    ("frame", "sill", "sash", "handle", "trim", "casing", "shutter", "blind", "curtain", "wood",
     "metal", "rahmen", "griff", "cadre", "marco", "telaio")
)  # fmt: skip


def glass_materials(gltf: Gltf, numbers: Iterable[int | None]) -> frozenset[int]:
    """Those of a window's or door's materials that are its glass by their names.

    "Pane" and "Window glass" are, "glass frame" is not. "Window" is when nothing else of the
    piece is clear: beside a glass it names the frame.
    """
    rows = {n: entry(gltf, "materials", n) for n in numbers if n is not None}
    words = {n: words_of_name(str(row.get("name", ""))) for n, row in rows.items()}
    glass = frozenset(n for n, w in words.items() if w & _GLASS and not w & _FRAME)
    if glass or any(_lets_light_through(row) for row in rows.values()):
        return glass
    return frozenset(n for n, w in words.items() if w & _WINDOW and not w & _FRAME)


def names_glass(name: str) -> bool:
    """Whether the name of a part of a window or door says that the part is glass."""
    words = words_of_name(name)
    return bool(words & _GLASS) and not words & _FRAME


def words_of_name(name: str) -> frozenset[str]:
    """Lower-case words of a name without accents; camelCase and digits part words."""
    parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    folded = unicodedata.normalize("NFKD", parted).casefold()
    plain = "".join(c for c in folded if not unicodedata.combining(c))
    return frozenset(re.findall(r"[^\W\d_]+", plain))


def _lets_light_through(row: dict[str, Any]) -> bool:
    has_transmission = "KHR_materials_transmission" in object_at(row, "extensions")
    return row.get("alphaMode") == "BLEND" or has_transmission
