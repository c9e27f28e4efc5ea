"""SVG pictures as element trees: every word in them is escaped; no effects."""

from __future__ import annotations

from xml.etree import ElementTree as ET

Element = ET.Element


def svg_picture(**attributes: object) -> Element:
    """An empty picture within a page; attributes as of `element`, which draws into it."""
    return _with(Element("svg"), attributes)


def svg_file(**attributes: object) -> Element:
    """An empty picture for a separate file."""
    return svg_picture(xmlns="http://www.w3.org/2000/svg", **attributes)


def element(parent: Element, tag: str, content: str = "", **attributes: object) -> Element:
    """Draw an element above parent's; in names "_" means "-", css is the class, empty attributes are left out."""
    child = _with(ET.SubElement(parent, tag), attributes)
    child.text = content or None
    return child


def svg_text(root: Element) -> str:
    """The picture as text."""
    return ET.tostring(root, encoding="unicode", short_empty_elements=False)


def _with(target: Element, attributes: dict[str, object]) -> Element:
    for name, value in attributes.items():
        if value != "":
            target.set("class" if name == "css" else name.replace("_", "-"), str(value))
    return target
