"""The material of a piece's mesh: its model's, under the home's overrides. No effects."""

from __future__ import annotations

from dataclasses import dataclass

from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.read.common.material_library import PANE_OPACITY, LoadedTexture
from pbrs_farm.read.common.model_materials import BLACK, GREY, WHITE
from pbrs_farm.read.mesh.mtl import ObjMaterial
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.sweethome3d.home_file.home_xml import Paint, PlanPicture, PlanPiece
from pbrs_farm.read.sweethome3d.piece_models import (
    LIGHT,
    MIRROR,
    PANE,
    SHININESS_SCALE,
    HomeMaterials,
    PieceModel,
    content_name,
)

CLEAR = 0.95  # Opacity below which a material counts as glass


@dataclass(frozen=True, slots=True)
class PieceMaterial:
    """The material of one mesh of a piece."""

    name: str  # the surface's: role and material
    material: int  # index in the library
    picture: PlanPicture | None  # layout of the home's own texture; None: by the model's uv
    emits: bool


def piece_material(
    piece: PlanPiece, mesh: Mesh, model: PieceModel, materials: HomeMaterials
) -> PieceMaterial | None:
    """Material of one mesh of a piece, and its texture layout; None if the home makes it invisible.

    The home's material of the same name takes precedence over the piece's colour or texture, and both
    over the model's. Transparent materials are panes in doors and windows, glass elsewhere.
    """
    base = model.materials.get(mesh.material) or ObjMaterial(mesh.material or "default")
    role = mesh.group
    paint = dict(piece.materials).get(mesh.material, Paint())
    if paint.is_hidden:
        return None
    # The piece's paint covers parts without a paint; panes and mirrors stay.
    if paint.is_empty and role not in (PANE, MIRROR):
        paint = Paint(
            piece.paint.colour,
            piece.paint.picture,
            piece.paint.shininess if paint.shininess is None else paint.shininess,
        )
    emits = role == LIGHT or mesh.material in piece.light_materials
    loaded, picture = _texture_of_mesh(piece, paint, base, mesh, model, materials)
    diffuse = WHITE if loaded else paint.colour or base.kd
    if loaded is None and base.map_kd and diffuse == BLACK:
        diffuse = GREY  # its picture cannot be had
    # The home's shininess replaces the model's highlights.
    specular, shininess = base.ks, base.ns
    if paint.shininess is not None:
        shine = min(max(paint.shininess, 0.0), 1.0)
        specular, shininess = (shine, shine, shine), shine * SHININESS_SCALE
    kind = _material_kind(piece, role, base, emits=emits, is_textured=loaded is not None)
    # Glass is transparent even if its model is opaque.
    opacity = base.d
    if kind in (MaterialKind.PANE, MaterialKind.GLASS) and opacity > CLEAR:
        opacity = PANE_OPACITY
    material = Material(
        name=mesh.material or "default",
        kind=kind,
        diffuse=diffuse,
        specular=specular,
        shininess=shininess,
        opacity=1.0 if kind in (MaterialKind.OPAQUE, MaterialKind.BULB) else opacity,
        texture_id=loaded.texture.id if loaded else None,
        alpha_cutout=bool(loaded and loaded.has_holes()),
    )
    name = f"{role}:{material.name}" if role else material.name
    return PieceMaterial(name, materials.library.index(material), picture, emits)


def _material_kind(
    piece: PlanPiece, role: str, base: ObjMaterial, *, emits: bool, is_textured: bool
) -> MaterialKind:
    is_clear = base.d < CLEAR and not is_textured
    if emits:
        return MaterialKind.BULB
    if role == MIRROR:
        return MaterialKind.MIRROR
    if role == PANE or is_clear:
        return MaterialKind.PANE if piece.frame is not None else MaterialKind.GLASS
    return MaterialKind.OPAQUE


def _texture_of_mesh(
    piece: PlanPiece,
    paint: Paint,
    base: ObjMaterial,
    mesh: Mesh,
    model: PieceModel,
    materials: HomeMaterials,
) -> tuple[LoadedTexture | None, PlanPicture | None]:
    """The mesh's texture, and how the home lays it (None: by the model's uv)."""
    if paint.picture is not None:
        loaded = materials.texture(paint.picture.image, piece.place)
        return loaded, paint.picture if loaded else None
    if paint.colour is not None or not base.map_kd or mesh.uvs is None:
        return None, None
    place = f"material {base.name}"
    loaded = materials.texture(content_name(model.folder, base.map_kd), place)
    # Opacity is read from the colour map's alpha alone.
    if base.map_d and base.map_d != base.map_kd:
        text = f"{base.map_d[:80]!r} is not the colour map's alpha"
        materials.notes.add("unused-opacity-map", place, text)
    return loaded, None
