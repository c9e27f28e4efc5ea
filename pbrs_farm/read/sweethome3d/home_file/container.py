"""A home file's bytes -> its XML tree and the contents it names. No effects."""

from __future__ import annotations

import posixpath
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final
from urllib.parse import unquote
from xml.etree.ElementTree import Element, ParseError

from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import fromstring

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.common.source_files import Layered, Resources, ZipResources
from pbrs_farm.read.mesh.obj import ObjModel
from pbrs_farm.read.sweethome3d.home_file.java_home import RESAVE, root_from_java

MAX_XML_BYTES = 16 * 2**20
MAX_DEPTH = 200  # nested elements
_PROGRAM_FOLDERS: Final = (
    "com/eteks/sweethome3d/io/resources/",
    "com/eteks/sweethome3d/io/resources/textures/",
)


@dataclass(frozen=True, slots=True)
class Container:
    """The root element <home>, and its models and textures. parsed: models of a home just generated."""

    root: Element
    contents: Resources
    parsed: Mapping[str, ObjModel] = field(default_factory=dict)


class _WebResources:
    """The program's own contents by the addresses that Sweet Home 3D JS gives them.

    Its files name them "lib/resources/models/armchair.zip!/armchair.obj", or by the address of a server.
    """

    def __init__(self, resources: Resources | None) -> None:
        self._resources = resources

    def read(self, name: str) -> bytes | None:
        """The program's content of that file name, or None for other names."""
        is_web = "!/" in name or "://" in name or name.startswith("lib/resources/")
        if self._resources is None or not is_web:
            return None
        file = posixpath.basename(unquote(name))
        places = (f"{folder}{file}" for folder in _PROGRAM_FOLDERS)
        return next((data for p in places if (data := self._resources.read(p)) is not None), None)


def open_container(data: bytes, file: str, resources: Resources | None) -> Container:
    """Open a zip or XML (resources: the program's models); BadHouse if unsafe or without Home.xml."""
    if data.startswith(b"PK"):
        archive = ZipResources(data, file)
        xml = archive.read("Home.xml")
        if xml is None:
            # Old versions, and homes saved without XML, hold the program's serialised objects alone.
            java = archive.read("Home")
            if java is None:
                raise BadHouse(file, "", "has no Home.xml and no Home", hint=RESAVE)
            return Container(root_from_java(java, file), Layered(archive, resources))
        contents = Layered(archive, resources, _WebResources(resources))
        return Container(_parse_xml(xml, file, "Home.xml"), contents)
    if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"<" or data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        contents = Layered(resources, _WebResources(resources))
        return Container(_parse_xml(data, file, ""), contents)
    raise BadHouse(file, "", "neither a .sh3d archive (zip) nor a Home.xml", hint=RESAVE)


def needs_program(data: bytes, file: str) -> bool:
    """Whether a home names models or pictures that its file does not hold: the program's own."""
    try:
        root = open_container(data, file, None).root
        archived = ZipResources(data, file).names() if data.startswith(b"PK") else ()
        # Models and pictures are all that a home names.
        named = {e.get(key) for e in root.iter() for key in ("model", "image")}
        return not {posixpath.normpath(name) for name in named if name} <= set(archived)
    except BadHouse:
        return False  # the reader reports the fault


def _parse_xml(xml: bytes, file: str, entry: str) -> Element:
    if len(xml) > MAX_XML_BYTES:
        raise BadHouse(file, entry, f"{len(xml)} bytes of XML, at most {MAX_XML_BYTES} are read")
    try:
        root: Element = fromstring(xml, forbid_dtd=False, forbid_entities=True)
    except DefusedXmlException as error:
        kind = type(error).__name__
        raise BadHouse(file, entry, f"entity definitions are not allowed ({kind})") from None
    except ParseError as error:
        raise BadHouse(file, entry, f"XML is not well-formed: {error}", hint=RESAVE) from None
    except (ValueError, LookupError, RecursionError):
        text = "XML cannot be read: unknown encoding, or nested too deeply"
        raise BadHouse(file, entry, text, hint=RESAVE) from None
    if root.tag != "home":
        raise BadHouse(file, entry, f"the root element is <{root.tag[:40]}>, not <home>")
    if _tree_depth(root) > MAX_DEPTH:
        raise BadHouse(file, entry, f"elements nested deeper than {MAX_DEPTH}")
    return root


def _tree_depth(root: Element) -> int:
    # Go down level by level: no recursion that a deep file could exhaust.
    depth, level = 0, [root]
    while level and depth <= MAX_DEPTH:
        depth, level = depth + 1, [child for element in level for child in element]
    return depth
