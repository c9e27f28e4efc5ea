"""Parts that joints move, closed, in the axes of their item's box, from house.glb alone; no effects."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import trimesh

from pbrs_farm.check.axes import out_of_frame
from pbrs_farm.check.embree_caster import Rays
from pbrs_farm.check.finishes import has_metallic_colour
from pbrs_farm.check.moved_house import joint_pose
from pbrs_farm.check.stored_mesh import Triangles
from pbrs_farm.core.arrays import F64, I64, Bools
from pbrs_farm.home.masses import Construction, constructions

_LEVEL = np.cos(
    np.radians(1)
)  # minimum cosine between a face's normal and an axis that it is across
_TRY = {"revolute": 0.3, "prismatic": 0.08}  # way of a trial movement, radians or metres
_STEPS, _POINTS = 4, 600  # of a trial movement
_AHEAD_M = 0.03  # rays towards the closed side begin before the part, metres
_PULL_M = 0.004  # depth of the foremost part of a front
_CLOSED = 0.9  # share of paired edges from which triangles bound a solid
_GLASSY = ("glass", "pane", "mirror")
_LEAST_M2 = 1e-12  # smaller faces have no direction


@dataclass(frozen=True, eq=False)
class MovingPart:
    """A part of an item and the item's static body."""

    joint: Mapping[str, Any]
    item: Triangles
    part: Bools  # (F,) its triangles
    body: Rays
    body_points: F64  # (N, 3)
    axes: F64  # (3, 3) columns: the axes of the item's box

    def moved(self, points: F64, by: float) -> F64:
        """Points (N, 3) moved along the joint, in radians or metres."""
        return out_of_frame(joint_pose(self.joint, by), points)

    @cached_property
    def corners(self) -> F64:
        """(F, 3, 3) its faces of some area, closed."""
        points = self.moved(self.item.points_of(self.part), -self.joint["value"])
        corners = points.reshape(-1, 3, 3)
        return np.asarray(corners[trimesh.triangles.area(corners) > _LEAST_M2])

    @cached_property
    def _areas(self) -> F64:
        return np.asarray(trimesh.triangles.area(self.corners), np.float64)

    @cached_property
    def _normals(self) -> F64:
        return np.cross(*np.diff(self.corners, axis=1).swapaxes(0, 1)) / 2 / self._areas[:, None]

    @cached_property
    def box(self) -> F64:
        """(2, 3) its corners along the axes, closed."""
        local = self.corners.reshape(-1, 3) @ self.axes
        return np.array([local.min(0), local.max(0)])

    @cached_property
    def along(self) -> int:
        """Number of the box's axis next to the joint's."""
        return int(np.argmax(np.abs(self.joint["axis"] @ self.axes)))

    @property
    def tilt(self) -> float:
        """Of its axis against that one, radians."""
        return float(np.arccos(min(1.0, np.abs(self.joint["axis"] @ self.axes).max())))

    @cached_property
    def _across(self) -> tuple[int, int]:
        """The axes through the thickness of a leaf and along its width."""
        a, b = (k for k in range(3) if k != self.along)
        return (a, b) if self._level(a).sum() > self._level(b).sum() else (b, a)

    def _level(self, k: int) -> F64:
        """(F,) areas of the faces across an axis of the box, 0 of all others."""
        return np.where(np.abs(self._normals @ self.axes[:, k]) > _LEVEL, self._areas, 0.0)

    @property
    def level_share(self) -> float:
        """Share of a leaf's area parallel to the item's box."""
        return float(self._level(self._across[0]).sum() / self._areas.sum())

    @cached_property
    def _pin(self) -> F64:
        return np.asarray(np.array(self.joint["point"], np.float64) @ self.axes)

    @property
    def edge_off(self) -> float:
        """Metres between a hinge and the nearer edge of its leaf."""
        wide = self._across[1]
        return float(np.abs(self.box[:, wide] - self._pin[wide]).min())

    @cached_property
    def _far_side(self) -> tuple[float, float]:
        """Signs of the leaf's width away from the hinge, and of the side to which its far edge moves."""
        thin, wide = self._across
        away = 1.0 if self.box[:, wide].mean() > self._pin[wide] else -1.0
        velocity = np.cross(self.joint["axis"], away * self.axes[:, wide])
        return away, 1.0 if velocity @ self.axes[:, thin] > 0 else -1.0

    @property
    def face_off(self) -> float:
        """Metres of a hinge before the face of its leaf on the side to which it opens."""
        thin, (_away, side) = self._across[0], self._far_side
        face = self._foremost(side * self.axes[:, thin], self._level(thin))
        return float(side * self._pin[thin] - face)

    def _foremost(self, direction: F64, areas: F64) -> float:
        """Position in a direction of the foremost faces, leaving 5 % of their areas (F,) out."""
        positions = self.corners.mean(1) @ direction
        order = np.argsort(positions)
        shares = np.cumsum(areas[order]) / max(areas.sum(), _LEAST_M2)
        return float(positions[order][min(np.searchsorted(shares, 0.95), len(order) - 1)])

    @property
    def pull(self) -> float:
        """Place of the foremost points of a leaf, as a share of its width from the hinge."""
        (thin, wide), (away, side) = self._across, self._far_side
        local = self.corners.reshape(-1, 3) @ self.axes
        front = side * local[:, thin]
        places = away * (local[front > front.max() - _PULL_M, wide] - self._pin[wide])
        return float((places.min() + places.max()) / 2 / np.ptp(self.box[:, wide]))

    @cached_property
    def _samples(self) -> F64:
        """(N, 3) points on its faces, closed; the same in each run."""
        rng = np.random.default_rng(0)
        faces = rng.choice(len(self._areas), _POINTS, p=self._areas / self._areas.sum())
        weights = rng.dirichlet([1, 1, 1], _POINTS)
        return np.asarray(np.einsum("nk,nkc->nc", weights, self.corners[faces]))

    def into_body(self, sign: float) -> float:
        """Share of its points that pass a face of the body at the beginning of a way, 0..1."""
        hits, before = np.zeros(_POINTS, bool), self._samples
        for by in np.linspace(0, sign * _TRY[self.joint["kind"]], _STEPS + 1)[1:]:
            after = self.moved(self._samples, float(by))
            face = self.body.first(before, after - before)
            way = self.body.distance(face, before, after - before)
            hits |= (face >= 0) & (way >= 0) & (way <= 1)
            before = after
        return float(hits.mean())

    @cached_property
    def body_box(self) -> F64:
        """(2, 3) corners of the static body along the axes."""
        local = self.body_points @ self.axes
        return np.array([local.min(0), local.max(0)])

    @property
    def beyond_sides(self) -> float:
        """Metres by which a closed part exceeds the body's box, on any side."""
        low, high = self.body_box
        return float(np.maximum(low - self.box[0], self.box[1] - high).max())

    def beyond(self, value: float) -> F64:
        """(2,) metres by which it exceeds the body's box along its axis at a value: behind, and ahead."""
        sign = 1.0 if self.joint["axis"] @ self.axes[:, self.along] > 0 else -1.0
        low, high = sorted(sign * self.box[:, self.along] + value)
        body_low, body_high = sorted(sign * self.body_box[:, self.along])
        return np.array([body_low - low, high - body_high])

    @cached_property
    def _behind(self) -> tuple[F64, F64]:
        """Of its corners with a body behind: positions along the axis, and distances, metres."""
        axis = np.array(self.joint["axis"], np.float64)
        points = self.corners.reshape(-1, 3)
        middles = np.repeat(self.corners.mean(1), 3, axis=0)
        points = np.concatenate([middles[::3], 0.98 * points + 0.02 * middles])
        back = np.broadcast_to(-axis, points.shape)
        face = self.body.first(points + _AHEAD_M * axis, back)
        gaps = self.body.distance(face, points + _AHEAD_M * axis, back) - _AHEAD_M
        return (points @ axis)[face >= 0], gaps[face >= 0]

    @property
    def gap(self) -> float:
        """Least distance in metres of a closed drawer from the body that stops it; inf without a body."""
        return float(np.abs(self._behind[1]).min(initial=np.inf))

    def sizes(self, of: str) -> tuple[float, ...]:
        """The measures that limits may be shares of, metres; 1 for radians."""
        length = float(np.ptp(self.box[:, self.along]))
        if of != "depth":
            return (length if of == "length" else 1.0,)
        axis = np.array(self.joint["axis"], np.float64)
        front = self._foremost(axis, np.where(self._normals @ axis > _LEVEL, self._areas, 0.0))
        positions, gaps = self._behind
        return front - float((positions - gaps).min(initial=front)), length


def mass_kg(
    item: Triangles, part: Bools, materials: Sequence[Mapping[str, Any]], only: int
) -> float:
    """Mass of triangles of an item, by the table of constructions; only: the class's material, else 0."""
    total = 0.0
    for surface in np.unique(item.surface[part]):
        chosen = part & (item.surface == surface)
        made = _construction(materials[int(item.material[chosen][0])], only)
        points = item.points_of(chosen).round(5)
        places, corner = np.unique(points, axis=0, return_inverse=True)
        faces = corner.reshape(-1, 3)
        # Faces that share a corner are one body.
        ends = np.concatenate([faces[:, :2], faces[:, 1:]])
        body = trimesh.graph.connected_component_labels(ends, node_count=len(places))[faces[:, 0]]
        exact = item.points_of(chosen).reshape(-1, 3, 3)
        for k in np.unique(body):
            total += _body_kg(exact[body == k], faces[body == k], made)
    return total


def _body_kg(corners: F64, faces: I64, made: Construction) -> float:
    walls = volume = made.wall_m * float(trimesh.triangles.area(corners).sum())
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    if len(counts) and np.mean(counts % 2 == 0) >= _CLOSED:
        volume = abs(float(np.linalg.det(corners - corners.mean((0, 1))).sum())) / 6
    return made.wall_kg_m3 * min(volume, walls) + made.core_kg_m3 * max(volume - walls, 0.0)


def _construction(material: Mapping[str, Any], only: int) -> Construction:
    words = set(re.findall("[a-z]+", str(material["name"]).casefold()))
    words |= {"glass"} if material["kind"] in _GLASSY else set()
    rows = [row for row in constructions() if row.only in (None, only)]
    named = [row for row in rows if words & set(row.words.split())]
    if not named and has_metallic_colour(material):
        named = [row for row in rows if "metal" in row.words.split()]
    return (named or [row for row in rows if only in row.classes] or rows[-1:])[0]
