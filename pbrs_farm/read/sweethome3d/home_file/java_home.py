"""The serialised entry `Home` of old .sh3d files -> the tree of the Home.xml that says the same.

No effects. The stream is read without Java. The elements are those that parse_home.py reads; fields that a
version of the program did not have yet are left out, so that the same defaults hold.

Not by javaobj-py3 (0.6.1): it recurses, and ends in RecursionError at a few hundred contents within each
other, where a home's joined walls, each written within its neighbour, nest by the thousand.
"""

from __future__ import annotations

import struct
from collections.abc import Generator, Iterable
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias
from urllib.parse import unquote
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from pbrs_farm.core.errors import BadHouse

MAX_STREAM_BYTES: Final = 64 * 2**20
_MAX_DEPTH: Final = 100_000  # calls under way; joined walls nest: a few calls for each
_MAX_CONTENTS: Final = 4_000_000  # objects, strings, arrays and nulls
_MAX_FIELDS: Final = 1_000  # of one class
_MAGIC: Final = b"\xac\xed\x00\x05"  # and version 5
_FIRST_HANDLE: Final = 0x7E0000
# Of a content's first byte.
_NULL, _REFERENCE, _CLASSDESC, _OBJECT, _STRING, _ARRAY, _CLASS = range(0x70, 0x77)
_BLOCK, _END, _RESET, _LONG_BLOCK, _EXCEPTION, _LONG_STRING, _PROXY, _ENUM = range(0x77, 0x7F)
# Of a class's flags.
_HAS_WRITE_METHOD, _IS_SERIALIZABLE, _IS_EXTERNALIZABLE, _HAS_BLOCKS = 1, 2, 4, 8
# fmt: off
_PRIMITIVES: Final = {
    "B": "b", "C": "H", "D": "d", "F": "f", "I": "i", "J": "q", "S": "h", "Z": "?",
}
# fmt: on


class JavaStreamError(ValueError):
    """The bytes are no stream this module reads; says at which byte."""


@dataclass(slots=True, eq=False)
class JavaObject:
    """An object of the stream: fields of all its classes, and what the classes wrote themselves."""

    class_name: str
    fields: dict[str, Any] = field(default_factory=dict)  # the subclass wins where two share a name
    written: list[Any] = field(default_factory=list)  # objects, strings and bytes, in order


@dataclass(slots=True, eq=False)
class _ClassDesc:
    name: str
    flags: int = 0
    fields: list[tuple[str, str]] = field(default_factory=list)  # (type letter, name)
    parent: _ClassDesc | None = None


_Call: TypeAlias = Generator["_Call", Any, Any]
"""A step that yields the step whose result it needs: nesting costs no Python stack."""


class _End:
    """End marker of a class's own data."""


_ENDED: Final = _End()


def java_objects(data: bytes) -> list[Any]:
    """Top-level contents: JavaObject, list, str (enums, too), bytes or None; JavaStreamError if damaged."""
    if len(data) > MAX_STREAM_BYTES:
        raise JavaStreamError(f"{len(data)} bytes, at most {MAX_STREAM_BYTES} are read")
    if not data.startswith(_MAGIC):
        raise JavaStreamError("byte 0: no Java serialisation stream")
    reader = _Reader(data)
    contents = []
    try:
        while not reader.is_done:
            contents.append(_run_calls(reader.content()))
    except struct.error:
        raise JavaStreamError(f"byte {reader.at}: the stream ends early") from None
    return contents


def _run_calls(call: _Call) -> Any:
    stack, result = [call], None
    while stack:
        try:
            inner = stack[-1].send(result)
        except StopIteration as stop:
            stack.pop()
            result = stop.value
        else:
            if len(stack) >= _MAX_DEPTH:
                raise JavaStreamError("its objects are nested too deep")
            stack.append(inner)
            result = None
    return result


class _Reader:
    """Walks over the bytes and remembers what the stream refers back to."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self.at = len(_MAGIC)
        self._handles: list[Any] = []
        self._n_contents = 0

    @property
    def is_done(self) -> bool:
        """Whether all bytes are read."""
        return self.at >= len(self._data)

    def _fail(self, text: str) -> JavaStreamError:
        return JavaStreamError(f"byte {self.at}: {text}")

    def _number(self, letter: str) -> Any:
        form = ">" + letter
        (value,) = struct.unpack_from(form, self._data, self.at)
        self.at += struct.calcsize(form)
        return value

    def _bytes(self, count: int) -> bytes:
        if not 0 <= count <= len(self._data) - self.at:
            raise self._fail(f"{count} bytes are expected, {len(self._data) - self.at} are left")
        self.at += count
        return self._data[self.at - count : self.at]

    def _utf(self, count: int) -> str:
        # Java writes zero as C0 80, and characters beyond 16 bits as two surrogates.
        raw = self._bytes(count).replace(b"\xc0\x80", b"\0")
        try:
            pairs = raw.decode("utf-8", "surrogatepass")
        except UnicodeDecodeError:
            raise self._fail("text that is not UTF-8") from None
        return pairs.encode("utf-16", "surrogatepass").decode("utf-16", "replace")

    def _remember(self, value: Any) -> Any:
        self._handles.append(value)
        return value

    def _referred(self) -> Any:
        number = self._number("I") - _FIRST_HANDLE
        if not 0 <= number < len(self._handles):
            raise self._fail("refers to an object that was not written")
        return self._handles[number]

    def content(self) -> _Call:
        """The next object, string, array, enum, block of bytes, null, or the end mark."""
        self._n_contents += 1
        if self._n_contents > _MAX_CONTENTS:
            raise self._fail(f"more than {_MAX_CONTENTS} objects")
        # A content begins with a type code (Java Object Serialization Specification, 6.4).
        code = self._number("B")
        if code == _NULL:
            return None
        if code == _REFERENCE:
            return self._referred()
        if code in (_STRING, _LONG_STRING):
            count = self._number("H" if code == _STRING else "q")
            return self._remember(self._utf(count))
        # Blocks contain data written by a class's own method; an end marker follows.
        if code in (_BLOCK, _LONG_BLOCK):
            return self._bytes(self._number("B" if code == _BLOCK else "i"))
        if code == _END:
            return _ENDED
        # Deeper contents are yielded, not called: a deep stream costs no Python stack.
        if code == _OBJECT:
            return (yield self._object())
        if code == _ARRAY:
            return (yield self._array())
        if code == _ENUM:
            return (yield self._enum())
        if code == _CLASS:
            yield self._class_desc()
            return self._remember(None)
        if code == _CLASSDESC:
            return (yield self._new_class())
        if code == _RESET:
            self._handles.clear()
            return (yield self.content())
        raise self._fail(f"unexpected code {code:#x}")

    def _class_desc(self) -> _Call:
        code = self._number("B")
        if code == _NULL:
            return None
        if code == _CLASSDESC:
            return (yield self._new_class())
        desc = self._referred() if code == _REFERENCE else None
        if not isinstance(desc, _ClassDesc):
            raise self._fail("expected a class")
        return desc

    def _new_class(self) -> _Call:
        desc = _ClassDesc(self._utf(self._number("H")))
        self._number("q")  # its version
        self._remember(desc)
        desc.flags, n_fields = self._number("B"), self._number("H")
        if n_fields > _MAX_FIELDS:
            raise self._fail(f"a class of {n_fields} fields")
        for _ in range(n_fields):
            letter, name = chr(self._number("B")), self._utf(self._number("H"))
            if letter in "[L":
                yield self.content()  # the name of its class
            elif letter not in _PRIMITIVES:
                raise self._fail(f"field {name[:40]!r} has no known type")
            desc.fields.append((letter, name))
        yield self._until_end([])
        desc.parent = yield self._class_desc()
        return desc

    def _until_end(self, into: list[Any]) -> _Call:
        while (value := (yield self.content())) is not _ENDED:
            into.append(value)

    def _value(self, letter: str) -> _Call:
        if letter in _PRIMITIVES:
            return self._number(_PRIMITIVES[letter])
        return (yield self.content())

    def _object(self) -> _Call:
        desc = yield self._class_desc()
        if desc is None:
            raise self._fail("an object without a class")
        instance = self._remember(JavaObject(desc.name))
        # Read the fields of the topmost class first.
        chain: list[_ClassDesc] = []
        up: _ClassDesc | None = desc
        while up is not None:
            if len(chain) >= _MAX_FIELDS:
                raise self._fail("a class with too many ancestors")
            chain.append(up)
            up = up.parent
        for part in reversed(chain):
            if part.flags & _IS_EXTERNALIZABLE and not part.flags & _HAS_BLOCKS:
                raise self._fail(f"{part.name[:80]} has a custom format")
            for letter, name in part.fields if part.flags & _IS_SERIALIZABLE else ():
                instance.fields[name] = yield self._value(letter)
            if part.flags & (_HAS_WRITE_METHOD | _IS_EXTERNALIZABLE):
                yield self._until_end(instance.written)
        return instance

    def _array(self) -> _Call:
        desc = yield self._class_desc()
        array: list[Any] = self._remember([])
        count, letter = self._number("i"), desc.name[1:2] if desc is not None else ""
        # Every element takes a byte or more, so a larger count is damage.
        if not 0 <= count <= len(self._data) - self.at:
            raise self._fail(f"an array of {count} elements")
        # "[I" names an array of int; its numbers follow without type codes.
        if letter in _PRIMITIVES:
            form = f">{count}{_PRIMITIVES[letter]}"
            array += struct.unpack_from(form, self._data, self.at)
            self.at += struct.calcsize(form)
            return array
        for _ in range(count):
            array.append((yield self.content()))
        return array

    def _enum(self) -> _Call:
        yield self._class_desc()
        number = len(self._handles)
        self._remember(None)
        name = yield self.content()
        if not isinstance(name, str) or number >= len(self._handles):
            raise self._fail("an enum without a name")
        self._handles[number] = name
        return name


RESAVE: Final = "open it in Sweet Home 3D 5.3 or later and save it again"
_ALONE: Final = "has no Home.xml, only the binary format of older versions,"
_MODEL: Final = "com.eteks.sweethome3d.model."
_MAX_GROUP_DEPTH: Final = 100
_UPRIGHT: Final = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
# Fields stored as attributes of the same name: numbers, flags, texts.
_WALL: Final = "xStart yStart xEnd yEnd thickness height heightAtEnd arcExtent"
_PIECE: Final = (
    "catalogId name creator x y elevation angle pitch roll width depth height modelMirrored"
    " doorOrWindow visible shininess staircaseCutOutShape wallWidth wallLeft wallHeight wallTop"
    " wallCutOutOnBothSides cutOutShape power"
)
_ROOM: Final = "name floorVisible ceilingVisible ceilingFlat"
_LEVEL: Final = "name elevation floorThickness height visible viewable elevationIndex"
_TEXTURE: Final = "catalogId name width height xOffset yOffset angle scale fittingArea"
_CAMERA: Final = "name x y z yaw pitch fieldOfView"
_TAGS: Final = {
    "HomePieceOfFurniture": "pieceOfFurniture",
    "HomeDoorOrWindow": "doorOrWindow",
    "HomeLight": "light",
    "HomeShelfUnit": "shelfUnit",
    "HomeFurnitureGroup": "furnitureGroup",
}


def root_from_java(data: bytes, file: str) -> Element:
    """The element <home> of a serialised Home; BadHouse for a damaged stream or another object."""
    try:
        objects = java_objects(data)
    except JavaStreamError as error:
        raise BadHouse(file, "Home", f"{_ALONE} which is damaged: {error}", hint=RESAVE) from None
    home = next((o for o in objects if _is(o, "Home")), None)
    if home is None:
        raise BadHouse(file, "Home", f"{_ALONE} which has no home", hint=RESAVE)
    return _Converter(home).root()


def _is(value: Any, *names: str) -> bool:
    return isinstance(value, JavaObject) and value.class_name.removeprefix(_MODEL) in names


def _elements_of_list(value: Any) -> list[Any]:
    """The elements of a Java list or array."""
    if isinstance(value, list):
        return value
    if not isinstance(value, JavaObject):
        return []
    # Lists that wrap another name it: Collections.unmodifiableList, Arrays.asList, singletonList.
    for name in ("list", "c", "a"):
        inner = value.fields.get(name)
        if isinstance(inner, (list, JavaObject)) and inner is not value:
            return inner if isinstance(inner, list) else inner.written[1:]
    if "element" in value.fields:
        return [value.fields["element"]]
    return [v for v in value.written if not isinstance(v, bytes)]  # bytes: its capacity


def _unbox(value: Any) -> Any:
    """A boxed number as a number."""
    if isinstance(value, JavaObject) and value.class_name.startswith("java.lang."):
        return value.fields.get("value")
    return value


def _attribute_text(value: Any) -> str | None:
    """As an XML attribute; None = left out. Floats have 32 bits in Java: shortest text of those."""
    value = _unbox(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        with np.errstate(over="ignore"):
            return str(np.float32(value))
    return str(value) if isinstance(value, (int, str)) else None


def _content_name(value: Any) -> str | None:
    """The entry that a content's URL names: jar:file:temp!/12/chair.obj -> 12/chair.obj."""
    url = value.fields.get("url") if isinstance(value, JavaObject) else None
    file = url.fields.get("file") if isinstance(url, JavaObject) else None
    return unquote(file.rpartition("!/")[2]) if isinstance(file, str) and "!/" in file else None


class _Converter:
    """Turns the objects of one home into elements."""

    def __init__(self, home: JavaObject) -> None:
        self._home = home.fields
        self._ids: dict[int, str] = {}  # of walls and levels, by object

    def root(self) -> Element:
        """The element <home> with everything in it."""
        # Write the element's own attributes, then the properties.
        version = _unbox(self._home.get("version"))
        root = Element("home", version=str(version or ""))
        _set_attribute(root, "name", self._home.get("name"))
        _set_attribute(root, "wallHeight", self._home.get("wallHeight"))
        properties = self._home.get("properties")
        texts = [t for t in _elements_of_list(properties) if isinstance(t, str)]
        for name, value in zip(texts[::2], texts[1::2], strict=False):
            SubElement(root, "property", name=name, value=value)
        # Write cameras and levels first: furniture, walls and rooms refer to levels.
        for camera in self._all("storedCameras", "Camera", "ObserverCamera"):
            tag = "observerCamera" if _is(camera, "ObserverCamera") else "camera"
            _fields(SubElement(root, tag, attribute="storedCamera"), camera, _CAMERA)
        for level in self._all("levels", "Level"):
            _fields(SubElement(root, "level", id=self._id(level)), level, _LEVEL)
        self._furniture(root)
        for wall in self._all("walls", "Wall"):
            self._wall(SubElement(root, "wall"), wall)
        for room in self._all("rooms", "Room"):
            self._room(SubElement(root, "room"), room)
        return root

    def _all(self, name: str, *classes: str) -> list[JavaObject]:
        return [o for o in _elements_of_list(self._home.get(name)) if _is(o, *classes)]

    def _id(self, thing: JavaObject) -> str:
        # Old versions wrote no ids.
        given_id = thing.fields.get("id")
        number = f"java-{len(self._ids)}"
        return self._ids.setdefault(id(thing), given_id if isinstance(given_id, str) else number)

    def _refer(self, element: Element, name: str, thing: Any) -> None:
        if isinstance(thing, JavaObject):
            element.set(name, self._id(thing))

    def _furniture(self, root: Element) -> None:
        # Versions with groups write the whole furniture apart, for older ones to read the rest.
        names = ("furnitureWithGroups", "furnitureWithDoorsAndWindows", "furniture")
        lists = (self._home.get(n) for n in names)
        pieces = next((x for x in lists if x is not None), None)
        # Walk the groups without recursion; an object that comes again is left out.
        stack = [(piece, root, 0) for piece in reversed(_elements_of_list(pieces))]
        visited: set[int] = set()
        while stack:
            piece, parent, depth = stack.pop()
            tag = next((t for name, t in _TAGS.items() if _is(piece, name)), None)
            if tag is None or id(piece) in visited or depth > _MAX_GROUP_DEPTH:
                continue
            visited.add(id(piece))
            element = SubElement(parent, tag)
            if tag == "furnitureGroup":
                _fields(element, piece, "name visible")
                self._refer(element, "level", piece.fields.get("level"))
                members = _elements_of_list(piece.fields.get("furniture"))
                stack += [(member, element, depth + 1) for member in reversed(members)]
            else:
                self._piece(element, piece)

    def _piece(self, element: Element, piece: JavaObject) -> None:
        _fields(element, piece, _PIECE)
        f = piece.fields
        self._refer(element, "level", f.get("level"))
        _set_attribute(element, "model", _content_name(f.get("model")))
        # Leave out what says nothing: a height as the piece's own, a rotation by nothing.
        in_plan = f.get("heightInPlan")
        if in_plan and in_plan != f.get("height"):
            _set_attribute(element, "heightInPlan", in_plan)
        if f.get("modelRotation") != _UPRIGHT:
            _add_points(element, "modelRotation", f.get("modelRotation"))
        _set_colours(element, piece, "color")
        _add_texture_element(element, None, f.get("texture"))
        # Write what the home changed of the model: materials, moved parts, light sources.
        for material in _elements_of_list(f.get("modelMaterials")):
            if _is(material, "HomeMaterial"):
                inner = SubElement(element, "material")
                _fields(inner, material, "name key shininess")
                _set_colours(inner, material, "color")
                _add_texture_element(inner, None, material.fields.get("texture"))
        for moved in _elements_of_list(f.get("modelTransformations")):
            if _is(moved, "Transformation"):
                inner = SubElement(element, "transformation")
                _fields(inner, moved, "name")
                _add_points(inner, "matrix", moved.fields.get("matrix"))
        for source in _elements_of_list(f.get("lightSources")):
            if _is(source, "LightSource"):
                inner = SubElement(element, "lightSource")
                _fields(inner, source, "x y z diameter")
                _set_colours(inner, source, "color")
        for name in _elements_of_list(f.get("lightSourceMaterialNames")):
            _set_attribute(SubElement(element, "lightSourceMaterial"), "name", name)

    def _wall(self, element: Element, wall: JavaObject) -> None:
        element.set("id", self._id(wall))
        _fields(element, wall, _WALL)
        f = wall.fields
        for name in ("wallAtStart", "wallAtEnd", "level"):
            self._refer(element, name, f.get(name))
        # Write what each side wears.
        _set_colours(element, wall, "leftSideColor rightSideColor topColor")
        for side in ("leftSide", "rightSide"):
            _set_attribute(element, f"{side}Shininess", f.get(f"{side}Shininess") or None)
            _add_texture_element(element, f"{side}Texture", f.get(f"{side}Texture"))
            board = f.get(f"{side}Baseboard")
            if isinstance(board, JavaObject) and _is(board, "Baseboard"):
                inner = SubElement(element, "baseboard", attribute=f"{side}Baseboard")
                _fields(inner, board, "thickness height")
                _set_colours(inner, board, "color")
                _add_texture_element(inner, None, board.fields.get("texture"))

    def _room(self, element: Element, room: JavaObject) -> None:
        _fields(element, room, _ROOM)
        self._refer(element, "level", room.fields.get("level"))
        _set_colours(element, room, "floorColor ceilingColor")
        for part in ("floor", "ceiling"):
            _set_attribute(element, f"{part}Shininess", room.fields.get(f"{part}Shininess") or None)
            _add_texture_element(element, f"{part}Texture", room.fields.get(f"{part}Texture"))
        for point in _elements_of_list(room.fields.get("points")):
            if isinstance(point, list) and len(point) == 2:
                inner = SubElement(element, "point")
                _set_attribute(inner, "x", point[0])
                _set_attribute(inner, "y", point[1])


def _set_attribute(element: Element, name: str, value: Any) -> None:
    text = _attribute_text(value)
    if text is not None:
        element.set(name, text)


def _fields(element: Element, thing: JavaObject, names: str) -> None:
    for name in names.split():
        _set_attribute(element, name, thing.fields.get(name))


def _set_colours(element: Element, thing: JavaObject, names: str) -> None:
    for name in names.split():
        value = _unbox(thing.fields.get(name))
        if isinstance(value, int):
            element.set(name, f"{value & 0xFFFFFFFF:08X}")


def _add_points(element: Element, name: str, rows: Any) -> None:
    flat = [v for row in _elements_of_list(rows) for v in (row if isinstance(row, list) else [row])]
    texts: Iterable[str | None] = map(_attribute_text, flat)
    if flat:
        element.set(name, " ".join(t for t in texts if t is not None))


def _add_texture_element(element: Element, attribute: str | None, texture: Any) -> None:
    if not _is(texture, "HomeTexture"):
        return
    inner = SubElement(element, "texture")
    _set_attribute(inner, "attribute", attribute)
    _fields(inner, texture, _TEXTURE)
    _set_attribute(inner, "image", _content_name(texture.fields.get("image")))
