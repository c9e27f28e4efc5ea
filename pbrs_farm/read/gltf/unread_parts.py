"""Notes of what a scene holds and no reader here looks at; no effects."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from pbrs_farm.formats.glb import Gltf
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.gltf.document import UNDERSTOOD, object_at
from pbrs_farm.read.gltf.mesh_primitives import has_surface

UNREAD: Final = "unread-part"

# Extensions without which nothing that is seen is missing: what a reader without them shows is
# there as well (compressed meshes, pictures), or they say nothing of the picture.
_UNSEEN: Final = frozenset({
    "KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu",
    "EXT_texture_avif", "MSFT_texture_dds", "KHR_materials_variants", "KHR_xmp", "KHR_xmp_json_ld",
    "KHR_animation_pointer", "FB_geometry_metadata",
})  # fmt: skip

_Row = dict[str, Any]
_PRIMITIVES: Final[dict[str, Callable[[_Row], bool]]] = {
    "points or lines": lambda row: not has_surface(row),
    "vertex colours": lambda row: "COLOR_0" in object_at(row, "attributes"),
    "morph targets": lambda row: bool(row.get("targets")),
}


def note_unread(gltf: Gltf, notes: Notes) -> None:
    """A note for every extension that is not read, and for what meshes and nodes have of such."""
    used = gltf.document.get("extensionsUsed")
    for name in used if isinstance(used, list) else []:
        if name not in UNDERSTOOD and name not in _UNSEEN:
            notes.add(UNREAD, "extensionsUsed", f"{name} is not read: what it adds is not shown")
    primitives = [_rows(mesh.get("primitives")) for mesh in _rows(gltf.document.get("meshes"))]
    for what, has in _PRIMITIVES.items():
        n = sum(any(map(has, rows)) for rows in primitives)
        if n:
            notes.add(UNREAD, "meshes", f"{n} of {len(primitives)} have {what}, which are not read")
    n = sum("skin" in node for node in _rows(gltf.document.get("nodes")))
    if n:
        notes.add(UNREAD, "nodes", f"{n} have a skin, which is not read: they stand as modelled")


def _rows(value: Any) -> list[_Row]:
    return [row for row in value if isinstance(row, dict)] if isinstance(value, list) else []
