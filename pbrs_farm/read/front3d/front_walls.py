"""Walls of a 3D-FRONT house: from sheets facing rooms to solids with holes.

No effects. Winding and normals are unreliable: a sheet faces the adjacent room. Coplanar sheets
of a room (tiles and their grout) are one wall: a hole is a gap in all of them and in the sheets
behind, else it is a niche. Solids meet in mitres, and repair cuts the holes, so that all have
jambs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import shapely

from pbrs_farm.core.arrays import F64
from pbrs_farm.core.house import Surface
from pbrs_farm.core.mesh import area_vectors
from pbrs_farm.geometry.solids import wall_prism
from pbrs_farm.read.common.doors_and_windows import Hole
from pbrs_farm.read.common.room_shells import plane_of_faces
from pbrs_farm.read.front3d.front_file import FrontMesh

_UPRIGHT: Final = 0.1  # |y| of a wall's normal, at most
_BESIDE_M: Final = 0.06  # from a sheet to the floor that it looks at
_DEPTHS_M: Final = (0.03, 0.5)  # from a sheet to the one behind it
_DEPTH_M: Final = 0.12  # where nothing is behind
_COLUMN_M: Final = 0.7  # a stretch without a sheet behind is no longer where a wall meets this one
_LEAST_M: Final = 0.02
_COPLANAR: Final = 0.9998  # least |cosine| of the normals of sheets in one plane: 1.1 degrees
_WITHIN_M: Final = 0.03  # maximum overhang of a sheet counted as part of another one, metres
_SEAM_M: Final = 0.002  # between the meshes of one wall
_HOLE_M: Final = 0.2  # least width and height
_FILLED: Final = 0.8  # share of a gap that the sheet behind fills: a niche
_SAME_END_M: Final = 0.03
_LONGEST_MITRE_M: Final = 0.8
MAX_SHEETS: Final = 1_200


@dataclass(frozen=True, slots=True, eq=False)
class Sheet:
    """A plane of a wall mesh, in its own axes: along (to the right of who looks at it) and up."""

    mesh: FrontMesh
    normal: F64  # (3,) unit, into the room; of an outer sheet either way
    along: F64
    offset: float  # normal @ p
    outline: Any  # shapely, (along, up)
    room: str
    uv: F64 | None  # (3, 2) of (along, up, 1)
    filled: Any = (
        None  # shapely: its outline and those of the other sheets of its plane; None: alone
    )

    @property
    def cover(self) -> Any:
        """Wall area in its plane; the rest is gaps."""
        return self.outline if self.filled is None else self.filled

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Along from, up from, along to, up to."""
        s0, y0, s1, y1 = self.outline.bounds
        return float(s0), float(y0), float(s1), float(y1)

    def point(self, s: float, y: float, behind: float = 0.0) -> F64:
        """(3,) world."""
        p = self.along * s + self.normal * (self.offset - behind)
        return np.asarray(p + np.array([0.0, y, 0.0]), np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class WallPiece:
    """A stretch of a sheet with one thickness."""

    sheet: Sheet
    s0: float
    s1: float
    depth: float  # of the sheet's solid
    through: float  # to the sheet behind
    back: Sheet | None

    @property
    def is_outside(self) -> bool:
        """Nothing, or the open air, is behind."""
        return self.back is None or self.back.mesh.kind != "WallInner"


def sheets_of(
    meshes: Sequence[FrontMesh], floors: Mapping[str, Any]
) -> tuple[list[Sheet], list[Sheet]]:
    """(the sheets that look into rooms, the outer ones). floors: room -> plan area.

    3D-FRONT's walls are sheets without thickness, each seen from one side. A sheet that looks into
    no room is left out.
    """
    inner: list[Sheet] = []
    outer: list[Sheet] = []
    tree, names = shapely.STRtree(list(floors.values())), list(floors)
    for mesh in meshes:
        for corners, uvs in _upright_planes(mesh):
            sheet = _sheet(mesh, corners, uvs)
            if sheet is None:
                continue
            if mesh.kind != "WallInner":
                outer.append(sheet)
                continue
            looking = _looking(sheet, floors, tree, names)
            if looking is not None:
                inner.append(looking)
    return _join_coplanar(inner), _join_coplanar(outer)


def _join_coplanar(sheets: Sequence[Sheet]) -> list[Sheet]:
    """Merge sheets with a larger one in the same plane and room.

    A tiled wall is two meshes: the tiles, and the net of grout between them. Each fills the gaps of
    the other. Adjacent sheets (tiles below, paint above) stay separate walls, and know each other's
    area.
    """
    normals = np.array([s.normal for s in sheets]).reshape(-1, 3)
    offsets = np.array([s.offset for s in sheets])
    rooms = np.unique([s.room for s in sheets], return_inverse=True)[1]
    areas = np.array([s.outline.area for s in sheets])
    joined: dict[int, Sheet] = {}
    is_upon = np.zeros(len(sheets), np.bool_)
    # The largest is the wall that the others lie upon; of equal ones the first.
    for k in np.argsort(-areas, kind="stable").tolist():
        sheet = sheets[k]
        if is_upon[k]:
            continue
        cosine = normals @ sheet.normal
        # Sheets of one room look the same way; an outer one is drawn from either side.
        aligned = np.abs(cosine) if not sheet.room else cosine
        offsets_apart = np.abs(sheet.offset - np.sign(cosine) * offsets)
        near = (rooms == rooms[k]) & (aligned > _COPLANAR) & (offsets_apart < _DEPTHS_M[0])
        near[k] = False
        outlines = {j: _outline_upon(sheets[j], sheet) for j in np.flatnonzero(near).tolist()}
        outlines = {
            j: o for j, o in outlines.items() if sheet.outline.envelope.intersects(o.envelope)
        }
        if not outlines:
            joined[k] = sheet
            continue
        upon = [j for j, o in outlines.items() if not is_upon[j] and _lies_upon(o, sheet.outline)]
        is_upon[upon] = True
        joined[k] = replace(
            sheet,
            outline=_united([sheet.outline, *(outlines[j] for j in upon)]),
            filled=_united([sheet.outline, *outlines.values()]),
        )
    return [joined[k] for k in sorted(joined)]


def _outline_upon(other: Sheet, sheet: Sheet) -> Any:
    """Another sheet's outline in the axes of this one."""

    def turned(points: F64) -> F64:
        world = points[:, :1] * other.along + other.normal * other.offset
        return np.column_stack([world @ sheet.along, points[:, 1]])

    return shapely.transform(other.outline, turned)


def _lies_upon(outline: Any, wall: Any) -> bool:
    """Whether an outline's bounds are within those of a wall."""
    bounds = shapely.box(*wall.bounds).buffer(_WITHIN_M, join_style="mitre")
    return bool(bounds.contains(shapely.box(*outline.bounds)))


def _united(outlines: Sequence[Any]) -> Any:
    """The outlines as one, the seams between them closed."""
    wide = shapely.buffer(np.array(outlines, object), _SEAM_M, join_style="mitre")
    return shapely.simplify(shapely.union_all(wide).buffer(-_SEAM_M, join_style="mitre"), 1e-3)


def _upright_planes(mesh: FrontMesh) -> list[tuple[F64, F64 | None]]:
    """(corners (F, 3, 3), uv (F, 3, 2)) of each upright plane."""
    surface = Surface("", mesh.points.astype(np.float32), mesh.faces, 0)
    corners = mesh.points[mesh.faces]
    uvs = None if mesh.uvs is None else mesh.uvs[mesh.faces]
    plane = plane_of_faces([surface])
    n = area_vectors(corners)
    size = np.linalg.norm(n, axis=1)
    upright = (np.abs(n[:, 1]) < _UPRIGHT * size) & (size > 1e-8)
    planes = []
    for k in np.unique(plane[upright]):
        mine = upright & (plane == k)
        if size[mine].sum() / 2 > 0.01:
            planes.append((corners[mine], None if uvs is None else uvs[mine]))
    return planes


def _sheet(mesh: FrontMesh, corners: F64, uvs: F64 | None) -> Sheet | None:
    n = area_vectors(corners)
    normal = n[np.linalg.norm(n, axis=1).argmax()] * [1, 0, 1]
    normal /= np.linalg.norm(normal)
    return _framed(mesh, normal, corners, uvs, "")


def _framed(mesh: FrontMesh, normal: F64, corners: F64, uvs: F64 | None, room: str) -> Sheet | None:
    along = np.array([normal[2], 0.0, -normal[0]])  # up x normal
    plan = np.stack([corners @ along, corners[..., 1]], -1)
    triangles: Any = shapely.polygons(plan)
    triangles = triangles[shapely.area(triangles) > 1e-8]
    if not len(triangles):
        return None
    outline = shapely.union_all(shapely.buffer(triangles, 1e-4, join_style="mitre"))
    outline = shapely.simplify(outline.buffer(-1e-4, join_style="mitre"), 1e-3)
    if outline.is_empty:
        return None
    uv = None
    if uvs is not None:
        flat = plan.reshape(-1, 2)
        system = np.column_stack([flat, np.ones(len(flat))])
        uv = np.linalg.lstsq(system, uvs.reshape(-1, 2), rcond=None)[0]
    return Sheet(mesh, normal, along, float((corners @ normal).mean()), outline, room, uv)


def _looking(sheet: Sheet, floors: Mapping[str, Any], tree: Any, names: list[str]) -> Sheet | None:
    """The sheet with its normal into its own room, else into the room beside it."""
    s0, _, s1, _ = sheet.bounds
    y = 0.0
    points = [(share, sign) for share in (0.5, 0.25, 0.75) for sign in (1.0, -1.0)]
    floor = floors.get(sheet.mesh.room)
    beside: tuple[str, float] | None = None
    for share, sign in points:
        p = sheet.point(s0 + share * (s1 - s0), y, -sign * _BESIDE_M)
        place = shapely.Point(p[0], p[2])
        if floor is not None and floor.contains(place):
            beside = (sheet.mesh.room, sign)
            break
        if beside is None:
            hits = tree.query(place, predicate="within")
            if len(hits):
                beside = (names[int(hits[0])], sign)
    if beside is None:
        return None
    room, sign = beside
    if sign > 0:
        return replace(sheet, room=room)
    # Looked at from the other side: what ran to the right runs to the left.
    turned = shapely.transform(sheet.outline, lambda p: p * [-1, 1])
    uv = None if sheet.uv is None else sheet.uv * np.array([[-1.0], [1.0], [1.0]])
    return Sheet(sheet.mesh, -sheet.normal, -sheet.along, -sheet.offset, turned, room, uv)


def pieces_of(inner: Sequence[Sheet], outer: Sequence[Sheet]) -> list[WallPiece]:
    """Split every inner sheet into stretches of one thickness.

    The back of a stretch is a parallel sheet, inner or outer, within the thickness of a wall. A
    stretch may have no back.
    """
    sheets = [*inner, *outer]
    normals = np.array([s.normal for s in sheets]).reshape(-1, 3)
    offsets = np.array([s.offset for s in sheets])
    wall_pieces: list[WallPiece] = []
    for sheet in inner:
        cosine = normals @ sheet.normal
        behind = sheet.offset - np.sign(cosine) * offsets
        fits = (np.abs(cosine) > 0.999) & (behind > _DEPTHS_M[0]) & (behind < _DEPTHS_M[1])
        backs = [(float(behind[k]), sheets[k]) for k in np.flatnonzero(fits)]
        wall_pieces += _stretches(sheet, [(d, b, _span(b, sheet)) for d, b in backs])
    return wall_pieces


def _span(other: Sheet, sheet: Sheet) -> tuple[float, float]:
    """Interval of another sheet along this one."""
    s0, _, s1, _ = other.bounds
    ends = [float(other.point(s, 0.0) @ sheet.along) for s in (s0, s1)]
    return min(ends), max(ends)


def _stretches(
    sheet: Sheet, backs: list[tuple[float, Sheet, tuple[float, float]]]
) -> list[WallPiece]:
    s0, _, s1, _ = sheet.bounds
    cuts = sorted({s0, s1, *(float(np.clip(v, s0, s1)) for _, _, span in backs for v in span)})
    runs: list[list[Any]] = []  # [from, to, distance, sheet behind]
    for low, high in pairwise(cuts):
        if high - low < 1e-6:
            continue
        middle = (low + high) / 2
        backs_here = [(d, b) for d, b, span in backs if span[0] < middle < span[1]]
        nearest = min(backs_here, key=lambda one: one[0], default=(0.0, None))
        if runs and abs(runs[-1][2] - nearest[0]) < 1e-3:
            runs[-1][1] = high
        else:
            runs.append([low, high, *nearest])
    # Where another wall joins from behind, take the thickness of the adjacent stretch.
    thick_runs = [r for r in runs if r[3] is not None]
    for k, run in enumerate(runs):
        if run[3] is None and thick_runs and run[1] - run[0] < _COLUMN_M:
            beside = [
                runs[j] for j in (k - 1, k + 1) if 0 <= j < len(runs) and runs[j][3] is not None
            ]
            if beside:
                run[2:] = min(beside, key=lambda r: r[2])[2:]
    joined: list[list[Any]] = []
    for run in runs:
        is_short = run[1] - run[0] < _LEAST_M
        if joined and (abs(joined[-1][2] - run[2]) < 1e-3 or is_short):
            joined[-1][1] = run[1]
        else:
            joined.append(list(run))
    wall_pieces = []
    for low, high, through, back in joined:
        is_inner = back is not None and back.mesh.kind == "WallInner"
        through = through if back is not None else _DEPTH_M
        wall_pieces.append(
            WallPiece(sheet, low, high, through / 2 if is_inner else through, through, back)
        )
    return wall_pieces


def solid_of(
    piece: WallPiece, pieces: Sequence[WallPiece], materials: tuple[int, int, int]
) -> tuple[Surface, ...]:
    """A piece of wall as a closed solid without holes, mitred with pieces. materials: room side, back, rest."""
    sheet = piece.sheet
    _, y0, _, y1 = sheet.bounds
    front = [sheet.point(s, 0.0)[[0, 2]] for s in (piece.s0, piece.s1)]
    back = [_back_corner(piece, s, front[k], pieces) for k, s in enumerate((piece.s0, piece.s1))]
    top = np.full(2, y1)
    room, behind, rest = materials
    parts = wall_prism(np.array(back), np.array(front), y0, top, top, (behind, room, rest))
    return tuple(_paint_inner_side(s, sheet) if s.name == "right" else s for s in parts)


def _paint_inner_side(surface: Surface, sheet: Sheet) -> Surface:
    """The side towards the room with the texture as the file lays it."""
    if sheet.uv is None:
        return surface
    p = surface.positions.astype(np.float64)
    system = np.column_stack([p @ sheet.along, p[:, 1], np.ones(len(p))])
    return replace(surface, uvs=(system @ sheet.uv).astype(np.float32))


def _back_corner(piece: WallPiece, s: float, corner: F64, pieces: Sequence[WallPiece]) -> F64:
    """Plan (2,) of a solid's back at an end: mitred with the neighbour's of the same room."""
    sheet = piece.sheet
    straight = sheet.point(s, 0.0, piece.depth)[[0, 2]]
    for neighbour in pieces:
        if neighbour.sheet is sheet or neighbour.sheet.room != sheet.room:
            continue
        if abs(neighbour.sheet.normal @ sheet.normal) > 0.95:
            continue
        ends = [neighbour.sheet.point(v, 0.0)[[0, 2]] for v in (neighbour.s0, neighbour.s1)]
        if min(float(np.linalg.norm(e - corner)) for e in ends) > _SAME_END_M:
            continue
        lines = np.array([sheet.normal[[0, 2]], neighbour.sheet.normal[[0, 2]]])
        offsets = [sheet.offset - piece.depth, neighbour.sheet.offset - neighbour.depth]
        mitred = np.linalg.solve(lines, np.array(offsets))
        if np.linalg.norm(mitred - straight) < _LONGEST_MITRE_M:
            return np.asarray(mitred, np.float64)
    return np.asarray(straight, np.float64)


def holes_of(pieces: Sequence[WallPiece]) -> list[tuple[Hole, WallPiece]]:
    """Gaps through the whole thickness, with their wall pieces; kind "open" until a door or window is assigned."""
    by_sheet: dict[int, list[WallPiece]] = {}
    for piece in pieces:
        by_sheet.setdefault(id(piece.sheet), []).append(piece)
    holes: list[tuple[Hole, WallPiece]] = []
    for own_pieces in by_sheet.values():
        sheet = own_pieces[0].sheet
        for s0, y0, s1, y1 in _gaps(sheet):
            middle = (s0 + s1) / 2
            piece = next((p for p in own_pieces if p.s0 <= middle <= p.s1), own_pieces[0])
            if piece.back is not None and _is_filled(piece.back, sheet, (s0, y0, s1, y1)):
                continue
            axes = np.stack([sheet.along, [0.0, 1.0, 0.0], sheet.normal], 1)
            hole = Hole(
                id=f"hole_{len(holes)}",
                kind="open",
                centre=sheet.point(middle, (y0 + y1) / 2, piece.through / 2),
                size=(s1 - s0, y1 - y0, piece.through),
                axes=axes,
            )
            holes.append((hole, piece))
    return holes


def _gaps(sheet: Sheet) -> list[tuple[float, float, float, float]]:
    s0, y0, s1, y1 = sheet.bounds
    rest = shapely.box(s0, y0, s1, y1).difference(sheet.cover)
    # Slivers along the edge are no holes.
    rest = rest.buffer(-0.02, join_style="mitre").buffer(0.02, join_style="mitre")
    gaps = []
    for part in shapely.get_parts(rest):
        a, b, c, d = (float(v) for v in part.bounds)
        if c - a >= _HOLE_M and d - b >= _HOLE_M and part.area > 0.6 * (c - a) * (d - b):
            gaps.append((a, max(b, y0), c, d))
    return gaps


def _is_filled(back: Sheet, sheet: Sheet, gap: tuple[float, float, float, float]) -> bool:
    """Whether the sheet behind a gap has no gap there."""
    s0, y0, s1, y1 = gap
    ends = [float(sheet.point(s, 0.0) @ back.along) for s in (s0, s1)]
    area = shapely.box(min(ends), y0, max(ends), y1)
    return bool(back.cover.intersection(area).area > _FILLED * area.area)
