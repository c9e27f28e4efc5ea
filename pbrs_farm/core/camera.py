"""Intrinsics, cameras and views; frozen values, no effects.

Inside the package a camera has OpenGL axes: x right, y up, looking along -z. Pixel (row 0,
column 0) is top left and its centre lies at (0.5, 0.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from pbrs_farm.core.arrays import F32, F64, Matrix4

# Full horizontal field of view of the published cameras: half-angle 0.5534 rad (docs/spec/suncg.md section 3).
PAPER_HFOV_RAD = 2 * 0.5534


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera without distortion, in pixels."""

    width_px: int
    height_px: int
    fx: float  # focal lengths
    fy: float
    cx: float  # principal point, from the top left corner
    cy: float

    @staticmethod
    def from_hfov(width_px: int, height_px: int, hfov_rad: float = PAPER_HFOV_RAD) -> Intrinsics:
        """Square pixels, principal point in the middle, full horizontal field of view hfov_rad."""
        f = 0.5 * width_px / math.tan(0.5 * hfov_rad)
        return Intrinsics(width_px, height_px, f, f, 0.5 * width_px, 0.5 * height_px)

    def resized(self, width_px: int, height_px: int) -> Intrinsics:
        """The same field of view on another pixel grid."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        return Intrinsics(
            width_px, height_px, self.fx * sx, self.fy * sy, self.cx * sx, self.cy * sy
        )

    def zoomed(self, factor: float) -> Intrinsics:
        """The focal length times factor: above 1 a narrower field of view."""
        return replace(self, fx=self.fx * factor, fy=self.fy * factor)

    @property
    def k(self) -> F64:
        """(3, 3) matrix K: pixel = K @ (x right, y down, z forward), divided by z."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Intrinsics and pose."""

    intrinsics: Intrinsics
    world_from_camera: Matrix4  # OpenGL axes, metres

    @staticmethod
    def look(
        intrinsics: Intrinsics,
        eye: F64,
        towards: F64,
        up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    ) -> Camera:
        """A camera at eye (3,) looking along towards (3,), any length; up must not be parallel to it."""
        # The camera looks along -z: build the right-handed frame from its back.
        back = -np.asarray(towards, np.float64)
        back = back / np.linalg.norm(back)
        right = np.cross(np.asarray(up, np.float64), back)
        right = right / np.linalg.norm(right)
        world_from_camera = np.eye(4)
        world_from_camera[:3, 0] = right
        world_from_camera[:3, 1] = np.cross(back, right)
        world_from_camera[:3, 2] = back
        world_from_camera[:3, 3] = eye
        return Camera(intrinsics, world_from_camera)

    @property
    def eye(self) -> F64:
        """(3,) position in the world, metres."""
        return self.world_from_camera[:3, 3]

    @property
    def towards(self) -> F64:
        """(3,) unit view direction in the world."""
        return np.asarray(-self.world_from_camera[:3, 2])

    def with_size(self, width_px: int, height_px: int) -> Camera:
        """The same camera on another pixel grid."""
        return Camera(self.intrinsics.resized(width_px, height_px), self.world_from_camera)

    def rays(self) -> tuple[F32, F32]:
        """Rays through the pixels' centres: origin (3,) and directions (H, W, 3), float32, world.

        Directions have unit length along the optical axis, so that t along a ray is depth_z.
        """
        origin, directions = self.exact_rays()
        return origin.astype(np.float32), directions.astype(np.float32)

    def exact_rays(self) -> tuple[F64, F64]:
        """As rays, in float64."""
        # A point of each pixel on the plane z = -1 of the camera: unit length along the axis.
        i = self.intrinsics
        x = (np.arange(i.width_px) + 0.5 - i.cx) / i.fx
        y = -(np.arange(i.height_px) + 0.5 - i.cy) / i.fy
        grid = np.empty((i.height_px, i.width_px, 3), np.float64)
        grid[..., 0] = x[None, :]
        grid[..., 1] = y[:, None]
        grid[..., 2] = -1.0
        return self.eye, grid @ self.world_from_camera[:3, :3].T


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A camera with its place in a house."""

    id: str  # keys.view_id
    room_id: str
    sector: int
    camera: Camera
    # "sampled", "stored" (placed by the home's author), "file" (the user's), "walk", "trajectory"
    origin: str = "sampled"
    score: float = 0.0  # the sampler's; 0 where there is none
    objects: dict[int, int] = field(default_factory=dict)  # instance id -> pixels when scored
    frame: int | None = None  # number in a sequence, from 0
    time_s: float | None = None  # of that frame
    left_id: str = ""  # of a stereo pair's right view: the id of the left one
