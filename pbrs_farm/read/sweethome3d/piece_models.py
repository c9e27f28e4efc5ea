"""Models and materials of a home: meshes per material with a role; each is parsed once; no effects."""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.errors import BadHouse
from pbrs_farm.core.frames import is_flattening
from pbrs_farm.core.house import Material
from pbrs_farm.read.common.material_library import LoadedTexture, MaterialLibrary
from pbrs_farm.read.common.notes import Notes
from pbrs_farm.read.common.source_files import Resources
from pbrs_farm.read.mesh.mtl import ObjMaterial, builtin_materials, laid, parse_mtl
from pbrs_farm.read.mesh.obj import Mesh, ObjModel, parse_obj
from pbrs_farm.read.sweethome3d.home_file.home_xml import Paint

SHININESS_SCALE = 128.0  # Phong exponent of the program's shininess 1


class HomeMaterials:
    """Resolves paints and textures of one home (or of the program) into its material library."""

    def __init__(self, contents: Resources, notes: Notes) -> None:
        self.contents = contents
        self.notes = notes
        self.library = MaterialLibrary(notes)

    def texture(self, name: str, place: str) -> LoadedTexture | None:
        """The texture of that content name, or None with a note if it cannot be used."""
        return self.library.texture(
            name,
            name=posixpath.basename(name),
            place=place,
            load=lambda: self.contents.read(posixpath.normpath(name)),
        )

    def painted(self, paint: Paint, name: str, place: str) -> int:
        """Index of a paint's material: its picture, else its colour, else white marked as default."""
        # A picture that can be used goes before the colour.
        loaded = None
        if paint.picture is not None:
            loaded = self.texture(paint.picture.image, place)
        shine = min(max(paint.shininess or 0.0, 0.0), 1.0)
        colour = paint.colour if loaded is None else None
        return self.library.index(
            Material(
                name=name,
                diffuse=colour or (1.0, 1.0, 1.0),
                specular=(shine, shine, shine),
                shininess=shine * SHININESS_SCALE,
                texture_id=None if loaded is None else loaded.texture.id,
                is_default=loaded is None and paint.colour is None,
            )
        )


_JOINT = re.compile(r"(?:^|_)((?:hinge|rail)_\d+|unique_rail)(?:_|$)")

HINGE = "sweethome3d_hinge_"
_FIXED = (HINGE, "sweethome3d_rail_", "sweethome3d_unique")
Transformations = tuple[tuple[str, tuple[float, ...]], ...]  # (name, 12 numbers)
PANE, MIRROR, LIGHT = "pane", "mirror", "light"
# Beginning of a group's name -> what the program makes of it.
_ROLES = (
    ("sweethome3d_window_pane", PANE),
    ("sweethome3d_window_mirror", MIRROR),
    ("sweethome3d_light", LIGHT),
)


def joint_of(name: str) -> str:
    """The joint a transformation or a group names: "hinge_1", "rail_2", "unique_rail", or ""."""
    match = _JOINT.search(name)
    return match[1] if match else ""


def moved(meshes: tuple[Mesh, ...], transformations: Transformations) -> tuple[Mesh, ...]:
    """The meshes with those on a moved joint moved; matrices are 3 x 4, row by row."""
    by_joint = {joint_of(name): matrix for name, matrix in transformations if joint_of(name)}
    return tuple(_move_joints(mesh, by_joint) for mesh in meshes)


def _move_joints(mesh: Mesh, by_joint: dict[str, tuple[float, ...]]) -> Mesh:
    joint = next((j for j in _hangers(mesh.group) if j in by_joint), None)
    return mesh if joint is None else _transformed(mesh, np.array(by_joint[joint]).reshape(3, 4))


def _hangers(group: str) -> Iterator[str]:
    """The joints that a group names as moving it; the hinge or rail itself stays where it is."""
    for word in group.split():
        if word.startswith(_FIXED):
            continue
        if joint := joint_of(word):
            yield joint
        elif word.startswith("sweethome3d_") and "_on_rail" in word:
            yield "unique_rail"


def hanger_of(group: str) -> str:
    """The joint that moves a group, "hinge_1"; "" for none, and for the hinge or rail itself."""
    return next(_hangers(group), "")


def fixed_joint_of(group: str) -> str:
    """The joint that a group is the hinge or rail of: "hinge_1"; "" for none."""
    joints = [joint_of(w) for w in group.split() if w.startswith(_FIXED)]
    return joints[0] if joints else ""


def hangs_on(mesh: Mesh, joints: frozenset[str]) -> bool:
    """Whether a mesh is moved by one of some joints; the hinge or rail itself is not."""
    return not joints.isdisjoint(_hangers(mesh.group))


def _transformed(mesh: Mesh, matrix: F64) -> Mesh:
    """The mesh transformed by a 3 x 4 matrix; unchanged if the matrix is singular."""
    linear = matrix[:, :3]
    if is_flattening(linear):
        return mesh
    # Normals take the inverse transpose; a mirror turns the faces over.
    normals = mesh.normals @ np.linalg.inv(linear)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0, length, 1)
    faces = mesh.faces if np.linalg.det(linear) > 0 else mesh.faces[:, [0, 2, 1]]
    positions = mesh.positions @ linear.T + matrix[:, 3]
    return replace(mesh, positions=positions, normals=normals, faces=faces)


@dataclass(frozen=True, slots=True, eq=False)
class PieceModel:
    """A parsed model."""

    meshes: tuple[Mesh, ...]  # in the model's frame
    hangers: tuple[str, ...]  # joint of each mesh: "hinge_1", "" = none
    materials: dict[str, ObjMaterial]  # by name
    folder: str  # of its content, for its pictures
    low: F64  # corner of its box
    high: F64  # corner of its box


def role_of(group: str) -> str:
    """The program's role for a group name: pane, mirror, light, or "" for none."""
    for word in group.split():
        for prefix, role in _ROLES:
            if word.startswith(prefix):
                return role
    return ""


class PieceModels:
    """Parsed models by content name; notes what cannot be read."""

    def __init__(
        self,
        materials: HomeMaterials,
        file: str,
        max_triangles: int,
        parsed: Mapping[str, ObjModel] | None = None,
    ) -> None:
        """parsed: models that need no reading."""
        self._materials = materials
        self._file = file
        self._max_triangles = max_triangles
        self._parsed: dict[str, ObjModel | None] = dict(parsed or {})
        self._models: dict[tuple[str, Transformations], PieceModel] = {}

    def get(
        self, name: str, place: str, transformations: Transformations = ()
    ) -> PieceModel | None:
        """The model of a piece, parsed once and moved as the home keeps it; None, with a note, if unusable."""
        if name not in self._parsed:
            self._parsed[name] = self._load(name, place)
        parsed = self._parsed[name]
        if parsed is None:
            return None
        key = (name, transformations)
        if key not in self._models:
            if transformations:
                parsed = replace(parsed, meshes=moved(parsed.meshes, transformations))
            self._models[key] = self._model(parsed, name)
        return self._models[key]

    def meshes(self, name: str) -> tuple[Mesh, ...]:
        """The meshes of a model as its file has them, with their groups; none if it is not there."""
        parsed = self._parsed.get(name)
        return parsed.meshes if parsed is not None else ()

    def add_opened(self, name: str, moves: Transformations, out: frozenset[str]) -> Transformations:
        """Transformations for a model with doors moved or left out (out); its box stays the shut one."""
        parsed = self._parsed[name]
        assert parsed is not None
        key = (*moves, *((f"out:{joint}", ()) for joint in sorted(out)))
        if (name, key) not in self._models:
            shut = self._models[(name, ())]
            shown = tuple(m for m in parsed.meshes if not hangs_on(m, out))
            opened = self._model(replace(parsed, meshes=moved(shown, moves)), name)
            self._models[(name, key)] = replace(opened, low=shut.low, high=shut.high)
        return key

    def _load(self, name: str, place: str) -> ObjModel | None:
        note, quoted = self._materials.notes.add, f"{name[:120]!r}"
        data = self._materials.contents.read(name)
        if data is None:
            note("missing-model", place, f"no content {quoted}: left out")
            return None
        kind = _model_format(data)
        if kind != "obj":
            note("unsupported-model", place, f"{quoted} is {kind}, only OBJ is read: left out")
            return None
        # A model of too many triangles ends the reading; a damaged one is left out.
        try:
            parsed = parse_obj(data, name, max_triangles=self._max_triangles)
        except BadHouse as error:
            if "at most" in error.message:
                raise BadHouse(self._file, place, error.message) from None
            note("unreadable-model", place, f"{error.message}: left out")
            return None
        if parsed.n_dropped:
            text = f"{parsed.n_dropped} faces without area dropped"
            note("degenerate-faces", f"model {name}", text)
        return parsed

    def _model(self, parsed: ObjModel, name: str) -> PieceModel:
        folder, note = posixpath.dirname(name), self._materials.notes.add
        # Start from the program's own materials; libraries of the model replace them.
        materials = dict(builtin_materials())
        for library in parsed.mtllibs:
            data = self._content(folder, library)
            if data is None:
                note("missing-materials", f"model {name}", f"no {library[:80]!r}")
                continue
            materials |= {material.name: material for material in parse_mtl(data)}
        # Note the names that neither of them knows.
        used = {m.material for m in parsed.meshes if m.material}
        unknown = sorted(used - set(materials))
        if unknown:
            note("unknown-material", f"model {name}", f"no material {', '.join(unknown)[:120]}")
        for material in (materials[name] for name in sorted(used & set(materials))):
            if material.unread:
                text = f"{material.name[:60]}: {', '.join(material.unread)} not read"
                note("unread-map", f"model {name}", text)
        meshes, hangers = _merge_meshes(
            tuple(laid(m, materials.get(m.material)) for m in parsed.meshes)
        )
        corners = [m.positions for m in meshes] or [np.zeros((1, 3))]
        points = np.concatenate(corners)
        return PieceModel(meshes, hangers, materials, folder, points.min(0), points.max(0))

    def _content(self, folder: str, name: str) -> bytes | None:
        return self._materials.contents.read(content_name(folder, name))


def content_name(folder: str, name: str) -> str:
    """A file named in a model, as a content name: foreign absolute paths keep their last part."""
    name = name.strip().strip('"').replace("\\", "/")
    parts = [p for p in name.split("/") if p not in ("", ".")]
    if name.startswith("/") or ":" in name or ".." in parts:
        parts = parts[-1:]
    return posixpath.join(folder, *parts) if parts else folder


def _model_format(data: bytes) -> str:
    # Tell the format by its first bytes.
    head = data[:4096].lstrip()
    if data[:2] == b"PK":
        return "a nested zip"
    if head[:5] == b"<?xml" or b"<COLLADA" in head:
        return "Collada"
    if data[:2] == b"MM":
        return "3DS"
    if head[:4] in (b"LWSC", b"FORM"):
        return "LightWave"
    if head[:4] == b"glTF":
        return "glTF"
    return "obj" if b"\0" not in head else "of an unknown kind"


def _merge_meshes(meshes: tuple[Mesh, ...]) -> tuple[tuple[Mesh, ...], tuple[str, ...]]:
    # One mesh per material, role, (having texture coordinates) and joint, in order of first use.
    grouped: dict[tuple[str, str, bool, str], list[Mesh]] = {}
    for mesh in meshes:
        key = (role_of(mesh.group), mesh.material, mesh.uvs is not None, hanger_of(mesh.group))
        grouped.setdefault(key, []).append(mesh)
    merged = []
    for (role, _, has_uvs, _), parts in grouped.items():
        # Number each part's vertices after those of the parts before it.
        first = np.cumsum([0, *(len(p.positions) for p in parts[:-1])])
        faces = np.concatenate([p.faces + n for p, n in zip(parts, first, strict=True)])
        uvs = [p.uvs for p in parts if p.uvs is not None]
        merged.append(
            replace(
                parts[0],
                group=role,
                positions=np.concatenate([p.positions for p in parts]),
                faces=faces.astype(np.int32),
                uvs=np.concatenate(uvs) if has_uvs else None,
                normals=np.concatenate([p.normals for p in parts]),
            )
        )
    return tuple(merged), tuple(hanger for *_, hanger in grouped)
