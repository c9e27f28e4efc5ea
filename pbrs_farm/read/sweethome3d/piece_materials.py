"""What a mesh of a piece looks like: its model's material under the home's overrides; no effects."""

from __future__ import annotations

from dataclasses import dataclass

from pbrs_farm.core.house import Material, MaterialKind
from pbrs_farm.read.mesh.mtl import ObjMaterial
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.sweethome3d.home_xml import Paint, Picture, PlanPiece
from pbrs_farm.read.sweethome3d.material_collector import SHININESS_SCALE, Looks
from pbrs_farm.read.sweethome3d.piece_models import LIGHT, MIRROR, PANE, Model, content_name

PANE_OPACITY = 0.2
CLEAR = 0.95
"""Opacity below which a material counts as glass."""


@dataclass(frozen=True, slots=True)
class Finish:
    """Material index and, where the home lays a texture of its own, how it lies."""

    name: str
    material: int
    picture: Picture | None
    emits: bool


def finish_of(piece: PlanPiece, mesh: Mesh, model: Model, looks: Looks) -> Finish | None:
    """The finish of one mesh, or None if the home makes it invisible."""
    base = model.materials.get(mesh.material) or ObjMaterial(mesh.material or "default")
    role = mesh.group
    paint = dict(piece.materials).get(mesh.material, Paint())
    if paint.is_hidden:
        return None
    if paint.is_empty and role not in (PANE, MIRROR):
        paint = Paint(
            piece.paint.colour,
            piece.paint.picture,
            piece.paint.shininess if paint.shininess is None else paint.shininess,
        )
    emits = role == LIGHT or mesh.material in piece.light_materials
    texture, has_alpha, picture = _texture(piece, paint, base, mesh, model, looks)
    diffuse = (1.0, 1.0, 1.0) if texture else paint.colour or base.kd
    specular, shininess = base.ks, base.ns
    if paint.shininess is not None:
        shine = min(max(paint.shininess, 0.0), 1.0)
        specular, shininess = (shine, shine, shine), shine * SHININESS_SCALE
    kind = _kind(piece, role, base, emits=emits, is_textured=texture is not None)
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
        texture_id=texture,
        alpha_cutout=has_alpha,
    )
    name = f"{role}:{material.name}" if role else material.name
    return Finish(name, looks.index(material), picture, emits)


def _kind(
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


def _texture(
    piece: PlanPiece, paint: Paint, base: ObjMaterial, mesh: Mesh, model: Model, looks: Looks
) -> tuple[str | None, bool, Picture | None]:
    # Texture id, whether its alpha cuts holes, and how the home lays it (None: by the model's uv).
    if paint.picture is not None:
        texture = looks.texture_id(paint.picture.image, piece.place)
        return texture, looks.has_alpha(texture), paint.picture if texture else None
    if paint.colour is not None or not base.map_kd or mesh.uvs is None:
        return None, False, None
    place = f"material {base.name}"
    texture = looks.texture_id(content_name(model.folder, base.map_kd), place)
    if base.map_d and base.map_d != base.map_kd:
        looks.note(
            "unused-opacity-map", place, f"{base.map_d[:80]!r} is not the colour map's alpha"
        )
    return texture, looks.has_alpha(texture), None
