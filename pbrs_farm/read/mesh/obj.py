"""Wavefront OBJ -> triangle meshes per (group, material), in numpy; lines and free forms are skipped. No effects."""

from __future__ import annotations

from codecs import BOM_UTF8
from dataclasses import dataclass, field

import numpy as np

from pbrs_farm.core.arrays import F64, I32, I64, Bools
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.mesh import face_areas
from pbrs_farm.core.shown_text import shown
from pbrs_farm.read.mesh.triangulate import crease_normals, triangulated_corners

DEFAULT_CREASE_RAD = np.radians(45.0)
_MANY_FACES = 50_000  # repeated faces are searched in parts of more faces


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles of one group and one material, in the model's own frame."""

    group: str
    material: str
    positions: F64  # (V, 3)
    faces: I32  # (F, 3)
    uvs: F64 | None  # (V, 2); None without texture coordinates
    normals: F64  # (V, 3) unit, creased where none are given
    colours: F64 | None = None  # (V, 3) linear, times the material's; None without vertex colours


@dataclass(frozen=True, slots=True, eq=False)
class ObjModel:
    """Contents of an OBJ file."""

    meshes: tuple[Mesh, ...]  # in the file's order
    mtllibs: tuple[str, ...]  # as written
    n_dropped: int = 0  # faces without area, and repeated ones of a huge mesh
    is_cut: bool = False  # ends within a line, or with vertices that no face uses


@dataclass(slots=True)
class _Part:
    """Faces of one group, material and shading, as written."""

    group: str
    material: str
    is_flat: bool
    lines: list[bytes] = field(default_factory=list)  # what follows each "f"
    seen: list[tuple[int, int, int]] = field(default_factory=list)  # v, vt, vn before it, or zeros


@dataclass(slots=True)
class _Statements:
    """An OBJ's statements by kind, numbers not yet parsed."""

    vertices: list[bytes] = field(default_factory=list)
    uvs: list[bytes] = field(default_factory=list)
    normals: list[bytes] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)
    parts: dict[tuple[str, str, bool], _Part] = field(default_factory=dict)


def parse_obj(data: bytes, file: str, *, max_triangles: int = 2_000_000) -> ObjModel:
    """Parse OBJ bytes; BadHouse for an invalid number or index, or more than max_triangles triangles."""
    data = data.removeprefix(BOM_UTF8)
    # Bound the work by counting lines before any is looked at.
    for key, most in ((b"\nf", max_triangles), (b"\nv ", 3 * max_triangles)):
        if data.count(key) > most:
            raise _too_many(file, data.count(key), key, max_triangles)
    # Join continued lines.
    if b"\\\n" in data or b"\\\r\n" in data:
        data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    statements = _statements(data)
    pools = (
        _parse_rows(statements.vertices, 3, file, "v"),
        _parse_rows(statements.uvs, 2, file, "vt"),
        _parse_rows(statements.normals, 3, file, "vn"),
    )
    # Bound what n-gons triangulate to.
    parts = statements.parts.values()
    n_triangles = sum(max(0, len(x.split()) - 2) for p in parts for x in p.lines)
    if n_triangles > max_triangles:
        raise _too_many(file, n_triangles, b"", max_triangles)
    built = [_mesh_of_part(p, pools, file) for p in parts]
    meshes = tuple(mesh for mesh, _ in built if mesh is not None)
    n_dropped = sum(dropped for _, dropped in built)
    return ObjModel(meshes, tuple(statements.libraries), n_dropped, _is_cut(data))


def _is_cut(data: bytes) -> bool:
    """Whether the last statement is no whole line, or a vertex of a face that never came."""
    last = data.rstrip(b" \t\r\n").rpartition(b"\n")[2].lstrip()
    return last[:1] == b"v" or (last[:1] in b"fgu" and not data.endswith((b"\n", b"\r")))


def _statements(data: bytes) -> _Statements:
    statements = _Statements()
    pools = {b"v": statements.vertices, b"vt": statements.uvs, b"vn": statements.normals}
    group, material, is_flat = "", "", False
    part: _Part | None = None  # where faces go, None after a change of group, material, shading
    for raw in data.splitlines():
        key, _, rest = raw.lstrip().partition(b" ")
        if key in pools:
            pools[key].append(rest)
        elif key == b"f":
            if part is None:
                name = (group, material, is_flat)
                part = statements.parts.setdefault(name, _Part(*name))
            part.lines.append(rest)
            # Negative indices count back from the lines so far.
            sizes = (len(statements.vertices), len(statements.uvs), len(statements.normals))
            part.seen.append(sizes if b"-" in rest else (0, 0, 0))
        # A tab after a keyword: begin anew with blanks, which is faster than to split by both.
        elif b"\t" in key:
            return _statements(data.replace(b"\t", b" "))
        elif key in (b"g", b"o"):
            group, part = _decoded_name(rest), None
        elif key == b"usemtl":
            material, part = _decoded_name(rest), None
        elif key == b"s":
            is_flat, part = rest.strip() in (b"off", b"0"), None
        elif key == b"mtllib":
            statements.libraries.append(_decoded_name(rest))
    return statements


def _too_many(file: str, n: int, key: bytes, most: int) -> BadHouse:
    noun = "vertices" if key.startswith(b"\nv") else "triangles or more"
    return BadHouse(
        file, "", f"{n} {noun}, at most {most} triangles are read", hint="read.max_model_triangles"
    )


def _decoded_name(rest: bytes) -> str:
    return rest.strip().decode("utf-8", "replace")


def _parse_rows(lines: list[bytes], n: int, file: str, what: str) -> F64:
    if not lines:
        return np.zeros((0, n))
    # Parse all lines together if they have equally many numbers; else pad or cut them.
    tokens = b" ".join(lines).split()
    # Colours after a position, or a third texture coordinate, are cut off below.
    per_line = len(tokens) // len(lines)
    if len(tokens) != per_line * len(lines) or per_line < n:
        rows = [(line.split() + [b"0"] * n)[:n] for line in lines]
        tokens, per_line = [t for row in rows for t in row], n
    elif any(len(line.split()) != per_line for line in lines):
        tokens = [t for line in lines for t in (line.split() + [b"0"] * n)[:n]]
        per_line = n
    try:
        values = np.array(tokens).astype(np.float64)
    except ValueError:
        raise BadHouse(file, *_word_at_fault(lines, what, float)) from None
    numbers = values.reshape(len(lines), per_line)[:, :n]
    if not np.isfinite(numbers).all():
        row = int(np.flatnonzero(~np.isfinite(numbers).all(1))[0])
        raise BadHouse(file, f"`{what}` line {row + 1}", "a coordinate is not a finite number")
    return numbers


def _word_at_fault(lines: list[bytes], what: str, kind: type[int] | type[float]) -> tuple[str, str]:
    """(place, text) of the first invalid number in an OBJ's lines of one kind."""
    for number, line in enumerate(lines, start=1):
        for word in line.split():
            try:
                fits = abs(kind(word)) < 2**63 or kind is float
            except ValueError:
                fits = False
            if not fits:
                text = shown(word.decode("utf-8", "replace"), 40)
                name = "an index" if kind is int else "a number"
                return f"`{what}` line {number}", f"{text!r} is not {name}"
    return f"a `{what}` line", "expected a number"


def _indices(part: _Part, pools: tuple[F64, ...], file: str) -> I64:
    # (n corners, 3) zero-based vertex, uv and normal index; -1 = none.
    # Parse all corners together if they have one form: v, v/vt, v//vn or v/vt/vn.
    joined = b" ".join(part.lines).replace(b"//", b"/0/")
    tokens = joined.split()
    slashes = {t.count(b"/") for t in tokens}
    if len(slashes) == 1 and max(slashes) <= 2:
        columns = 1 + max(slashes)
        flat = joined.replace(b"/", b" ").split()
    else:
        columns = 3
        flat = [c or b"0" for t in tokens for c in [*t.split(b"/"), b"0", b"0"][:3]]
    try:
        numbers = np.array(flat).astype(np.int64).reshape(len(tokens), columns)
    except (ValueError, OverflowError):
        lines = [line.replace(b"/", b" ") for line in part.lines]
        raise BadHouse(file, *_word_at_fault(lines, "f", int)) from None
    indices = np.zeros((len(tokens), 3), np.int64)
    indices[:, :columns] = numbers
    if (numbers < 0).any():
        # Negative indices are relative to the vertices read before the face.
        per_line = [len(x.split()) for x in part.lines]
        counts_before = np.repeat(np.asarray(part.seen, np.int64).reshape(-1, 3), per_line, axis=0)
        indices = np.where(indices < 0, indices + counts_before + 1, indices)
    # A missing vertex is an error; missing textures and normals are tolerated.
    for k, noun in enumerate(("vertex", "texture", "normal")):
        low, high = int(indices[:, k].min()), int(indices[:, k].max())
        if low < (1 if k == 0 else 0) or high > len(pools[k]):
            if k == 0:
                bad = low if low < 1 else high
                text = f"{noun} {bad} of {len(pools[k])} does not exist"
                raise BadHouse(file, "an `f` line", text)
            indices[(indices[:, k] > len(pools[k])) | (indices[:, k] < 0), k] = 0
    return indices - 1


def _mesh_of_part(part: _Part, pools: tuple[F64, ...], file: str) -> tuple[Mesh | None, int]:
    sizes = np.array([len(x.split()) for x in part.lines], np.int64)
    if not sizes.sum():
        return None, len(sizes)
    indices = _indices(part, pools, file)
    crease = 0.0 if part.is_flat else DEFAULT_CREASE_RAD
    return mesh_from_corners(part.group, part.material, indices, sizes, pools, crease)


def mesh_from_corners(
    group: str,
    material: str,
    indices: I64,
    sizes: I64,
    pools: tuple[F64, ...],
    crease_rad: float = DEFAULT_CREASE_RAD,
) -> tuple[Mesh | None, int]:
    """The mesh of polygons (None without area), and the number of dropped triangles.

    indices: (n corners, 3) zero-based position, uv and normal, -1 = none; sizes: corners of each
    polygon; pools: positions (V, 3), uvs (T, 2), normals (N, 3).
    """
    # Triangulate, and drop triangles without area.
    corners = triangulated_corners(pools[0][indices[:, 0]], sizes)
    index = indices[corners]
    v = index[:, :, 0]
    keep = face_areas(pools[0][v]) > 0
    if len(v) > _MANY_FACES:
        keep &= _first_of_each(v)
    n_dropped = int((~keep).sum())
    index = index[keep]
    if not len(index):
        return None, n_dropped
    points = pools[0]
    # Use a face's texture coordinates where every corner has them; (0, 0) for the mesh's others.
    uv_index, uv_pool = index[:, :, 1], pools[1]
    is_textured: Bools = np.all(uv_index >= 0, axis=1)
    has_uvs = bool(is_textured.any())
    if has_uvs and not is_textured.all():
        uv_index = np.where(is_textured[:, None], uv_index, len(uv_pool))
        uv_pool = np.concatenate([uv_pool, np.zeros((1, 2))])
    # Use normals where every corner has one.
    if (index[:, :, 2] >= 0).all():
        normal_pool, normal_index = pools[2], index[:, :, 2]
    else:
        normal_pool, normal_index = crease_normals(points, index[:, :, 0], crease_rad)
    keys = np.stack([index[:, :, 0], uv_index if has_uvs else 0 * normal_index, normal_index], -1)
    # Make a vertex of each different (position, uv, normal).
    unique, faces = _unique_rows(keys.reshape(-1, 3))
    normals = normal_pool[unique[:, 2]]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = Mesh(
        group,
        material,
        points[unique[:, 0]],
        faces.reshape(-1, 3).astype(np.int32),
        uv_pool[unique[:, 1]] if has_uvs else None,
        normals / np.where(length > 0, length, 1),
    )
    return mesh, n_dropped


def _first_of_each(v: I64) -> Bools:
    """(F,) bool: no face before has the same corners (mass copies unbalance ray trees), if many are copies."""
    _, first = np.unique(v, axis=0, return_index=True)
    is_first = np.full(len(v), 2 * len(first) > len(v))
    is_first[first] = True
    return is_first


def _unique_rows(rows: I64) -> tuple[I64, I64]:
    # The distinct rows, in sorted order, and for each row its place among them.
    # Code a row as one number where that fits into 64 bits: sorting is faster.
    spans = rows.max(0) + 1
    if float(spans[0]) * float(spans[1]) * float(spans[2]) > 2.0**62:
        unique, inverse = np.unique(rows, axis=0, return_inverse=True)
        return unique, inverse.reshape(-1)
    code = (rows[:, 0] * spans[1] + rows[:, 1]) * spans[2] + rows[:, 2]
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    return rows[first], inverse.reshape(-1)
