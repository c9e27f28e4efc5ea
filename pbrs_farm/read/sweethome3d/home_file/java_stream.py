"""A Java serialisation stream -> plain objects, without Java. No effects.

Not by javaobj-py3 (0.6.1): it recurses, and ends in RecursionError at a few hundred contents within each
other, where a home's joined walls, each written within its neighbour, nest by the thousand.
"""

from __future__ import annotations

import struct
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

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
