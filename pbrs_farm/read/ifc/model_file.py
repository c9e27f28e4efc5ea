"""An IFC file as the library parses it, after what would hang or kill the library is refused.

Effects: reads files. References of IFC lead from a row to rows that it is made of, never back.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pbrs_farm.core.errors import BadHouse
from pbrs_farm.read.common.source_files import ZipResources
from pbrs_farm.regular_files import read_given, text_from_bytes

_MOST_BYTES: Final = 512 * 2**20
_MOST_ROWS: Final = 5_000_000
_STRING: Final = re.compile(rb"'(?:[^']|'')*'")
_COMMENT: Final = re.compile(rb"/\*.*?\*/", re.DOTALL)
_NUMBER: Final = re.compile(rb"#(\d{1,18})(\s*=)?")
_SCHEMA: Final = re.compile(r"(FILE_SCHEMA\s*\(\s*\(\s*')([^']{1,40})'", re.IGNORECASE)
# Prefixes of schema names, and the supported schema of each family.
_SCHEMAS: Final = (("IFC2X", "IFC2X3"), ("IFC4X", "IFC4X3_ADD2"), ("IFC4", "IFC4"))
_NAMED: Final = ("Name", "Description", "ObjectType", "Tag", "LongName", "ElementType")


def model_of(path: Path) -> Any:
    """The checked ifcopenshell.file of a .ifc or .ifczip; BadHouse, naming the invalid row."""
    import ifcopenshell

    data = _bytes_of(path)
    _check_step_file(data, path)
    try:
        model = ifcopenshell.file.from_string(
            _in_known_schema(text_from_bytes(data, "replace"), path)
        )
    except (RuntimeError, OSError, ValueError, ifcopenshell.Error) as error:
        text = " ".join(str(error).split())[:200] or "the library cannot parse it"
        raise BadHouse(path, "", f"damaged: {text}") from None
    if model is None or not model.by_type("IfcProject"):
        raise BadHouse(path, "", "has no IfcProject", hint="export the whole model again")
    _mend_names(model)
    _remove_broken_relations(model)
    return model


def _in_known_schema(text: str, path: Path) -> str:
    """The text with the known schema of its family (IFC 2x, 4x3 drafts ...); BadHouse for another."""
    named = _SCHEMA.search(text)
    schema = named[2].upper() if named else ""
    near = next((known_name for begins, known_name in _SCHEMAS if schema.startswith(begins)), None)
    if named is None or near is None:
        hint = "export it as IFC2x3, IFC4 or IFC4x3"
        raise BadHouse(
            path, "FILE_SCHEMA", f"is {schema or 'missing'}, which is not supported", hint=hint
        )
    return text[: named.start(2)] + near + text[named.end(2) :]


def _bytes_of(path: Path) -> bytes:
    if path.suffix.lower() != ".ifczip":
        return read_given(path, error=BadHouse)
    archive = ZipResources(path, path.name)
    names = [n for n in archive.names() if n.lower().endswith((".ifc", ".ifcxml"))]
    if len(names) != 1:
        raise BadHouse(path, "", f"has {len(names)} IFC files, expected one")
    return archive.read(names[0]) or b""


def _check_step_file(data: bytes, path: Path) -> None:
    """Raise BadHouse for data that is not IFC in STEP form, or damaged so that the library might hang."""
    head = data[:2000].lstrip(b"\xef\xbb\xbf \r\n\t")
    hint = "export it as IFC (.ifc, STEP), IFC2x3 or IFC4"
    if head[:1] == b"<":
        raise BadHouse(path, "", "is IFCXML, which is not supported", hint=hint)
    if head[:1] in (b"{", b"["):
        raise BadHouse(path, "", "is JSON (IFC5), which is not supported", hint=hint)
    if not head.startswith(b"ISO-10303-21"):
        raise BadHouse(path, "", "is not an IFC file: it does not begin with ISO-10303-21")
    if len(data) > _MOST_BYTES:
        raise BadHouse(path, "", f"is larger than {_MOST_BYTES // 2**20} MB")
    plain = _STRING.sub(b"''", data)
    if plain.count(b"'") % 2:
        line = 1 + data.count(b"\n", 0, _last_quote(data))
        raise BadHouse(path, f"line {line}", "a string is not closed")
    plain = _COMMENT.sub(b"", plain)
    if b"/*" in plain:
        raise BadHouse(path, "", "a comment is not closed")
    if b"END-ISO-10303-21" not in plain:
        raise BadHouse(path, "", "is cut short: its end is missing", hint="copy it again")
    _check_references(plain[plain.find(b"DATA;") :], path)


def _last_quote(data: bytes) -> int:
    """Where the string begins that does not end."""
    position = 0
    for match in _STRING.finditer(data):
        position = match.end()
    return data.find(b"'", position)


def _check_references(plain: bytes, path: Path) -> None:
    tokens = _NUMBER.findall(plain)
    if not tokens:
        raise BadHouse(path, "DATA", "is empty")
    numbers = np.array([int(n) for n, _ in tokens], np.int64)
    begins = np.array([bool(e) for _, e in tokens])
    if begins.sum() > _MOST_ROWS:
        raise BadHouse(path, "DATA", f"has more than {_MOST_ROWS} rows")
    ids, counts = np.unique(numbers[begins], return_counts=True)
    if (counts > 1).any():
        raise BadHouse(path, f"#{ids[counts > 1][0]}", "exists twice")
    # Each number belongs to the row that began before it.
    row = np.cumsum(begins) - 1
    is_use = ~begins & (row >= 0)
    used, user = numbers[is_use], numbers[begins][row[is_use]]
    place = np.searchsorted(ids, used)
    is_known = (place < len(ids)) & (ids[np.minimum(place, len(ids) - 1)] == used)
    if not is_known.all():
        k = int(np.flatnonzero(~is_known)[0])
        raise BadHouse(path, f"#{user[k]}", f"names #{used[k]}, which does not exist")
    start = np.searchsorted(ids, user)
    graph = coo_array((np.ones(len(start), np.int8), (start, place)), shape=(len(ids), len(ids)))
    _, label = connected_components(graph, directed=True, connection="strong")
    is_cyclic = (np.bincount(label) > 1)[label]
    is_cyclic[start[start == place]] = True
    if is_cyclic.any():
        raise BadHouse(path, f"#{ids[is_cyclic][0]}", "a cycle of references")


def _mend_names(model: Any) -> None:
    """Set names that read as nothing to nothing: one program writes `*` there, and meshing fails."""
    for entity in ("IfcProduct", "IfcTypeProduct", "IfcMaterial", "IfcPresentationStyle"):
        for row in model.by_type(entity):
            for name in _NAMED:
                if getattr(row, name, "") is None:
                    setattr(row, name, None)


def _remove_broken_relations(model: Any) -> None:
    """Remove relations that lack one of their sides, such as an opening without a wall."""
    from ifcopenshell.ifcopenshell_wrapper import schema_by_name

    schema: Any = schema_by_name(model.schema_identifier)
    for row in model.by_type("IfcRelationship"):
        attributes = schema.declaration_by_name(row.is_a()).all_attributes()
        if any(
            row[k] is None and not attribute.optional()
            for k, attribute in enumerate(attributes)
            if attribute.name().startswith("Relat")
        ):
            model.remove(row)
