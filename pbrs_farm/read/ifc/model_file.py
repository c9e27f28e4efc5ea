"""An IFC file as the library parses it, after what would hang or kill the library is refused; its meshes.

Effects: reads files. References of IFC lead from a row to rows that it is made of, never back. Meshes have
their openings cut, in metres, z up.
"""

from __future__ import annotations

import multiprocessing
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pbrs_farm.core.arrays import F64, I64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import transform_points
from pbrs_farm.core.mesh import closed_edge_share, signed_volume
from pbrs_farm.core.recipe import ReadFields
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


_MOST_THREADS: Final = 8
# Faceted shapes by the quick kernel (300,000 triangles in 8 s; in 170 s by the other), all else by
# the one that knows curves.
_KERNEL: Final = "hybrid-cgal-simple-opencascade"
_WELD_DECIMALS: Final = 6  # of metres: corners nearer than a micrometre are one


@dataclass(frozen=True, slots=True)
class Style:
    """How a part of a product looks."""

    name: str
    rgb: tuple[float, float, float] | None  # sRGB-encoded; None: the style has no colour
    transparency: float  # 0..1


@dataclass(frozen=True, slots=True, eq=False)
class ProductMesh:
    """Triangles of a product in its own frame."""

    positions: F64  # (V, 3)
    faces: I64  # (F, 3)
    style_of_face: I64  # (F,) index into styles, -1 = none
    styles: tuple[Style, ...]
    world_from_product: F64  # (4, 4), z up

    @property
    def world(self) -> F64:
        """(V, 3) corners in the world, z up."""
        return transform_points(self.world_from_product, self.positions)


def meshes_of_products(
    model: Any, products: Sequence[Any], file: str, fields: ReadFields
) -> dict[int, ProductMesh]:
    """Meshes by row number, without failed ones; BadHouse for more than read.max_triangles."""
    import ifcopenshell.geom

    settings = ifcopenshell.geom.settings()
    settings.set("no-normals", True)
    settings.set("apply-default-materials", False)
    settings.set("reorient-shells", True)
    settings.set("circle-segments", 16)
    meshes: dict[int, ProductMesh] = {}
    if not products:
        return meshes
    n_threads = min(multiprocessing.cpu_count(), _MOST_THREADS)
    iterator = ifcopenshell.geom.iterator(
        settings, model, n_threads, include=list(products), geometry_library=_KERNEL
    )
    if not iterator.initialize():
        return meshes
    n_faces = 0
    while True:
        shape = iterator.get()
        mesh = _mesh_of_shape(shape)
        if mesh is not None:
            n_faces += len(mesh.faces)
            place = f"#{shape.id} {shape.name}"[:80]
            if len(mesh.faces) > fields.max_model_triangles:
                text = f"more than {fields.max_model_triangles} triangles"
                raise BadHouse(file, place, text, hint="limit: read.max_model_triangles")
            if n_faces > fields.max_triangles:
                text = f"more than {fields.max_triangles} triangles"
                raise BadHouse(file, place, text, hint="limit: read.max_triangles")
            meshes[shape.id] = mesh
        if not iterator.next():
            return meshes


class Whole(NamedTuple):
    """A product without a shape, assembled from other products."""

    world_from_product: F64  # (4, 4), z up, metres
    parts: tuple[int, ...]  # numbers of their rows


def with_wholes(
    meshes: Mapping[int, ProductMesh], wholes: Mapping[int, Whole]
) -> dict[int, ProductMesh]:
    """The meshes by their rows' numbers, parts replaced by the products that they make."""
    united = dict(meshes)
    for number, whole in wholes.items():
        parts = [united.pop(p) for p in whole.parts if p in united]
        if not parts:
            continue
        own_from_world = np.asarray(np.linalg.inv(whole.world_from_product))
        positions = [transform_points(own_from_world, p.world) for p in parts]
        points = np.cumsum([0, *(len(p.positions) for p in parts)])
        styles = np.cumsum([0, *(len(p.styles) for p in parts)])
        united[number] = ProductMesh(
            np.concatenate(positions),
            np.concatenate([p.faces + k for p, k in zip(parts, points, strict=False)]),
            np.concatenate(
                [
                    np.where(p.style_of_face < 0, -1, p.style_of_face + k)
                    for p, k in zip(parts, styles, strict=False)
                ]
            ),
            tuple(style for p in parts for style in p.styles),
            whole.world_from_product,
        )
    return united


def _mesh_of_shape(shape: Any) -> ProductMesh | None:
    geometry = shape.geometry
    positions = np.asarray(geometry.verts, np.float64).reshape(-1, 3)
    faces = np.asarray(geometry.faces, np.int64).reshape(-1, 3)
    if not len(faces) or not np.isfinite(positions).all():
        return None
    styles = tuple(_style(row) for row in geometry.materials)
    numbers = np.asarray(geometry.material_ids, np.int64)
    if len(numbers) != len(faces):
        numbers = np.full(len(faces), -1)
    matrix = np.asarray(shape.transformation.matrix, np.float64).reshape(4, 4).T
    items = np.asarray(geometry.item_ids, np.int64)
    if len(items) != len(faces):
        items = np.zeros(len(faces), np.int64)
    return ProductMesh(positions, _facing_out(positions, faces, items), numbers, styles, matrix)


def _facing_out(positions: F64, faces: I64, items: I64) -> I64:
    """The faces, turned where a closed body (such as a mirrored mapped item) would face inwards."""
    turned = faces.copy()
    for item in np.unique(items):
        is_of_item = items == item
        corners = positions[faces[is_of_item]]
        # Ask for the sign first: nearly all bodies are sound.
        if signed_volume(corners, corners.reshape(-1, 3).mean(0)) >= 0:
            continue
        if closed_edge_share(np.round(corners, _WELD_DECIMALS)) == 1.0:
            turned[is_of_item] = faces[is_of_item][:, ::-1]
    return turned


def _style(row: Any) -> Style:
    colour = row.diffuse
    rgb = tuple(float(c) for c in getattr(colour, "components", colour)) if colour else ()
    is_given = len(rgb) == 3 and bool(np.isfinite(rgb).all())
    passes = float(row.transparency)
    clear = float(np.clip(passes, 0, 1)) if np.isfinite(passes) else 0.0
    r, g, b = (float(np.clip(c, 0, 1)) for c in rgb) if is_given else (0.0, 0.0, 0.0)
    return Style(str(row.name)[:100], (r, g, b) if is_given else None, clear)
