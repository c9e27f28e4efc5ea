"""A piece of furniture -> its frame in the world and its placed surfaces; no effects."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbrs_farm.core.arrays import F64, triple
from pbrs_farm.core.frames import affine, linear_from_srgb, rotation_x, rotation_y, rotation_z
from pbrs_farm.core.house import Box, LightPart, Surface
from pbrs_farm.core.lighting import BULB_RADIUS_M, PowerUnit
from pbrs_farm.core.mesh import cross_products
from pbrs_farm.read.mesh.obj import Mesh
from pbrs_farm.read.sweethome3d.home_file.home_xml import PlanLevel, PlanPicture, PlanPiece
from pbrs_farm.read.sweethome3d.piece_materials import PieceMaterial
from pbrs_farm.read.sweethome3d.piece_models import PieceModel
from pbrs_farm.read.sweethome3d.wall_solids import picture_uvs

_FLAT = 1e-9  # an extent below it has no scale


@dataclass(frozen=True, slots=True, eq=False)
class PieceFrame:
    """A piece's own frame: origin in its box's middle, x right, y up, z to its front, metres."""

    origin: F64
    axes: F64  # (3, 3), columns are the frame's unit axes in the world
    half: F64  # half extents of its box
    mirror: float  # -1 if the model is mirrored along x, else 1

    @property
    def box(self) -> Box:
        """The piece's oriented box."""
        return Box(self.origin, self.half, self.axes)

    def world(self, local: F64) -> F64:
        """(N, 3) world points of local ones."""
        return np.asarray(local @ self.axes.T + self.origin)


def frame_of(piece: PlanPiece, level: PlanLevel, local_height: F64 | None = None) -> PieceFrame:
    """Pose of a piece: its centre and axes in the world, its size.

    local_height: (N, 3) the points of its model in its own frame; the program centres the box of the
    tilted points on the piece's place. Angles of the file run clockwise seen from above; pitch is
    applied before roll.
    """
    width, depth, height = piece.size
    half = np.array([width, height, depth]) / 2
    # Pitch, then roll, then turn about the vertical; the program's angles run clockwise.
    tilt = rotation_z(-piece.roll) @ rotation_x(-piece.pitch)
    axes = rotation_y(-piece.angle) @ tilt
    in_plan, offset = height, np.zeros(3)
    if piece.pitch or piece.roll:
        if local_height is not None and len(local_height):
            tilted = local_height @ tilt.T
            low, high = tilted.min(0), tilted.max(0)
            in_plan, offset = float(high[1] - low[1]), rotation_y(-piece.angle) @ (low + high) / 2
        elif piece.height_in_plan is not None:
            in_plan = piece.height_in_plan
    x, z = piece.centre
    origin = np.array([x, level.elevation + piece.elevation + in_plan / 2, z]) - offset
    return PieceFrame(origin, axes, half, -1.0 if piece.is_mirrored else 1.0)


def local_from_model(piece: PlanPiece, model: PieceModel) -> F64:
    """(4, 4) from the model's frame to the piece's: centred, turned, scaled to the piece's size."""
    turn = np.eye(3) if piece.rotation is None else np.array(piece.rotation).reshape(3, 3)
    # Turn the model about its middle and measure it anew.
    centre = (model.low + model.high) / 2
    if piece.rotation is None:
        low, high = model.low - centre, model.high - centre
    else:
        points = [(m.positions - centre) @ turn.T for m in model.meshes] or [np.zeros((1, 3))]
        low = np.min([p.min(0) for p in points], axis=0)
        high = np.max([p.max(0) for p in points], axis=0)
    extent = high - low
    width, depth, height = piece.size
    # Scale it to the piece's size; axes without extent are kept.
    size = np.array([width, height, depth])
    scale = np.where(extent > _FLAT, size / np.maximum(extent, _FLAT), 1)
    scale[0] *= -1.0 if piece.is_mirrored else 1.0
    linear = scale[:, None] * turn
    return affine(linear, -linear @ centre - scale * (low + high) / 2)


def placed_surface(
    mesh: Mesh, painted: PieceMaterial, frame: PieceFrame, local: F64, matrix: F64
) -> Surface:
    """One mesh of a piece in the world. local: (V, 3) its points in the piece's frame."""
    normals = mesh.normals @ _inverse_transpose(frame.axes @ matrix[:3, :3]).T
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = normals / np.where(length > 0, length, 1)
    # A mirrored model's faces would look inwards.
    is_mirrored = np.linalg.det(matrix[:3, :3]) < 0
    faces = mesh.faces[:, [0, 2, 1]] if is_mirrored else mesh.faces
    uvs = mesh.uvs
    if painted.picture is not None:
        uvs = _projected(local, normals @ frame.axes, frame.half, painted.picture)
    return Surface(
        name=painted.name,
        positions=np.ascontiguousarray(frame.world(local), np.float32),
        faces=np.ascontiguousarray(faces, np.int32),
        material=painted.material,
        uvs=None if uvs is None else np.ascontiguousarray(uvs, np.float32),
        normals=np.ascontiguousarray(normals, np.float32),
    )


def _inverse_transpose(linear: F64) -> F64:
    # A piece flat along an axis has no inverse: its cofactors do, up to a positive scale.
    columns = linear.T
    cofactors = cross_products(columns[[1, 2, 0]], columns[[2, 0, 1]]).T
    return cofactors * (-1.0 if np.linalg.det(linear) < 0 else 1.0)


def _projected(local: F64, normals: F64, half: F64, picture: PlanPicture) -> F64:
    # Metres right and up on the side of the box that each vertex's normal faces.
    p = local + half
    axis = np.abs(normals).argmax(1)
    right = np.where(axis == 0, p[:, 2], p[:, 0])
    up = np.where(axis == 1, -p[:, 2], p[:, 1])
    if picture.is_fitting:
        spans = 2 * np.maximum(half, 1e-6)
        right = right / np.where(axis == 0, spans[2], spans[0])
        up = up / np.where(axis == 1, spans[2], spans[1])
        return np.stack([right, up], -1)
    return picture_uvs(np.stack([right, up], -1), picture)


def light_parts(
    piece: PlanPiece, frame: PieceFrame, emitting: tuple[int, ...]
) -> tuple[LightPart, ...]:
    """One light per source, none if switched off; the first, or one amid the box, has the emitting surfaces."""
    if piece.power <= 0:
        return ()
    width, height, depth = 2 * frame.half
    sources = [
        (
            np.array(
                [
                    (s.at[0] - 0.5) * width * frame.mirror,
                    (s.at[2] - 0.5) * height,
                    (0.5 - s.at[1]) * depth,
                ]
            ),
            s.colour,
            BULB_RADIUS_M if s.diameter is None else s.diameter * width / 2,
        )
        for s in piece.lights
    ]
    # A lamp that only has a glowing mesh gets a source in its middle.
    if not sources and emitting:
        sources = [(np.zeros(3), (1.0, 1.0, 1.0), BULB_RADIUS_M)]
    # Share the lamp's power by the sources' brightness; colours keep their hue at full value.
    strength = [max(colour) for _, colour, _ in sources]
    total = sum(strength)
    parts: list[LightPart] = []
    for k, (local, colour, radius) in enumerate(sources):
        if total <= 0 or strength[k] <= 0:
            continue
        rgb = linear_from_srgb(np.array(colour) / max(colour))
        x, y, z = frame.world(local[None])[0]
        parts.append(
            LightPart(
                position=(float(x), float(y), float(z)),
                radius_m=max(float(radius), 1e-3),
                power=piece.power,
                unit=PowerUnit.SWEETHOME3D,
                share=strength[k] / total,
                rgb_linear=triple(rgb),
                emitting=emitting if not parts else (),
            )
        )
    return tuple(parts)
