"""Colours, textures and baseboards of walls, rooms and furniture as the XML gives them. No effects."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from pbrs_farm.read.sweethome3d.home_file.home_xml import Baseboard, Paint, PlanPicture
from pbrs_farm.read.sweethome3d.home_file.xml_attributes import Attributes


def wall_paint(a: Attributes, side: str) -> Paint:
    """The paint of a wall's "left" or "right" side, or of its "top"."""
    if side == "top":
        return _paint_of(a, "topColor", None, None)
    return _paint_of(a, f"{side}SideColor", f"{side}SideTexture", f"{side}SideShininess")


def room_paint(a: Attributes, part: str) -> Paint:
    """The paint of a room's "floor" or "ceiling"."""
    return _paint_of(a, f"{part}Color", f"{part}Texture", f"{part}Shininess")


def piece_paint(a: Attributes) -> Paint:
    """The paint that overrides a whole piece, or one of its materials."""
    paint = _paint_of(a, "color", "", "shininess")
    alpha = a.argb("color")
    # A material of alpha 0 is how the program hides a part.
    is_hidden = a.element.tag == "material" and alpha is not None and alpha[0] == 0
    return Paint(paint.colour, paint.picture, paint.shininess, is_hidden)


def _paint_of(a: Attributes, colour: str, texture: str | None, shininess: str | None) -> Paint:
    argb = a.argb(colour)
    picture = None
    if texture is not None:
        # A texture of a wall or room names its side, a piece's need not; the last one counts.
        for element in a.element.findall("texture"):
            if not texture or element.get("attribute") == texture:
                picture = picture_of(a, element)
    shine = a.optional(shininess) if shininess else None
    return Paint(None if argb is None else argb[1], picture, shine)


def picture_of(parent: Attributes, element: Element) -> PlanPicture:
    """A <texture> element; sizes that make no sense count as one metre."""
    name = element.get("name", "")
    a = Attributes(parent.file, f"{parent.place} texture '{name}'", element, parent.max_extent_m)
    width, height = a.metres("width", 1.0), a.metres("height", 1.0)
    scale = a.number("scale", 1.0)
    return PlanPicture(
        image=a.text("image"),
        name=name,
        width=width if width > 1e-4 else 1.0,
        height=height if height > 1e-4 else 1.0,
        offset=(a.number("xOffset", 0.0) % 1.0, a.number("yOffset", 0.0) % 1.0),
        angle=a.number("angle", 0.0),
        scale=scale if scale > 1e-4 else 1.0,
        is_fitting=a.flag("fittingArea", False),
    )


def baseboard_of(wall: Attributes, element: Element) -> Baseboard | None:
    """A <baseboard> of a wall, or None if it has no size."""
    side = element.get("attribute", "")
    a = Attributes(wall.file, f"{wall.place} {side}", element, wall.max_extent_m)
    thickness, height = a.length("thickness", 0.0), a.length("height", 0.0)
    if thickness <= 0 or height <= 0:
        return None
    return Baseboard(
        is_left=side.startswith("left"),
        thickness=thickness,
        height=height,
        paint=_paint_of(a, "color", "", None),
    )
