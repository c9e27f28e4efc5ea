"""Intrinsics, cameras and views; frozen values, no effects. The one place that makes rays.

Inside the package a camera has OpenGL axes: x right, y up, looking along -z. Pixel (row 0,
column 0) is top left with its centre at (0.5, 0.5).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import F32, F64, Mask, Matrix4
from pbrs_farm.core.checked_calls import Size, Vector, check_argument, checked_call
from pbrs_farm.core.errors import BadInput
from pbrs_farm.core.frames import OPENCV_FROM_OPENGL, affine
from pbrs_farm.core.lenses import COEFFICIENTS, PINHOLE, Lens, lens_of_opencv
from pbrs_farm.core.pinhole_faces import PinholeFaces, faces_of_directions
from pbrs_farm.core.shot import Shot

# Full horizontal field of view of the published cameras: half-angle 0.5534 rad (docs/spec/suncg.md section 3).
PAPER_HFOV_RAD = 2 * 0.5534

DEFAULT_SIZE: Final = (640, 480)
"""Width and height of pictures, pixels: of recipes that say none."""

_BORDER_POINTS: Final = 65  # of each side of a picture, where a fold is looked for
_OTHER_SIZE: Final = 0.2  # maximum offset of a principal point from the middle, share of the size
_SAME_SHARE: Final = 0.1  # tolerance between two equal shares

_FLIP: Final[F64] = np.diag(OPENCV_FROM_OPENGL)[:3]  # OpenGL's axes <-> OpenCV's


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """The size of a picture, the lens, and K: from the lens's plane to pixels."""

    width_px: int
    height_px: int
    fx: float  # focal lengths; of an equirectangular picture pixels per rad
    fy: float
    cx: float  # principal point, from the top left corner; of a cube map its first face's
    cy: float
    lens: Lens = PINHOLE

    @staticmethod
    def from_hfov(width_px: int, height_px: int, hfov_rad: float = PAPER_HFOV_RAD) -> Intrinsics:
        """Square pixels, principal point in the middle, full horizontal field of view hfov_rad."""
        f = 0.5 * width_px / math.tan(0.5 * hfov_rad)
        return Intrinsics(width_px, height_px, f, f, 0.5 * width_px, 0.5 * height_px)

    def resized(self, width_px: int, height_px: int) -> Intrinsics:
        """The same field of view on another pixel grid; another aspect stretches the picture."""
        sx, sy = width_px / self.width_px, height_px / self.height_px
        return Intrinsics(
            width_px, height_px, self.fx * sx, self.fy * sy, self.cx * sx, self.cy * sy, self.lens
        )

    def zoomed(self, factor: float) -> Intrinsics:
        """The focal length times factor: above 1 a narrower field of view. Not for panoramas."""
        return replace(self, fx=self.fx * factor, fy=self.fy * factor)

    @property
    def k(self) -> F64:
        """(3, 3) matrix K: pixel = K @ (x, y, 1) of the lens's plane.

        Of a pin-hole the plane's point is (x right / z, y down / z).
        """
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]], np.float64)

    def directions(self, pixels: F64) -> F64:
        """(N, 3) directions of pixel coordinates (N, 2), OpenCV's axes, as Lens.directions."""
        plane = (pixels - [self.cx, self.cy]) / [self.fx, self.fy]
        return self.lens.directions(plane)

    def pixels(self, directions: F64) -> F64:
        """(N, 2) pixel coordinates of directions (N, 3), OpenCV's axes; NaN for those the lens does not see."""
        return np.asarray(
            self.lens.plane_points(directions) * [self.fx, self.fy] + [self.cx, self.cy]
        )


def intrinsics_from_k(
    size: tuple[int, int] | None, k: Any, hfov_deg: float, distortion: Any = ()
) -> Intrinsics:
    """Intrinsics of a picture of (width, height) from K (3, 3), or from a field of view.

    size: None = DEFAULT_SIZE, with a field of view alone. With K the field of view is ignored; without
    it pixels are square and hfov_deg is between 0 and 175. Raises BadInput for a size below 1 pixel, for
    such a field of view, for a K that is not (3, 3) finite numbers or has a skew or a focal length that is
    not positive, and for a K of another picture size. distortion: as of `lens_of_opencv`; a lens that folds the
    picture raises BadInput, too.
    """
    if np.size(distortion):
        return distorted_intrinsics(intrinsics_from_k(size, k, hfov_deg), distortion)
    if size is None and k is not None:
        raise BadInput("camera", "size", "is missing", hint="the picture size for K")
    width, height = (int(v) for v in (DEFAULT_SIZE if size is None else size))
    if min(width, height) < 1:
        raise BadInput("camera", "size", f"{width}x{height} is not a size")
    if k is None:
        if not 0 < hfov_deg < 175:
            raise BadInput("camera", "hfov_deg", f"{hfov_deg:g} is not within 0..175")
        return Intrinsics.from_hfov(width, height, math.radians(hfov_deg))
    matrix = np.asarray(k, np.float64)
    shape_fits = matrix.shape == (3, 3) and np.isfinite(matrix).all()
    if not shape_fits or min(matrix[0, 0], matrix[1, 1]) <= 0 or abs(matrix[0, 1]) > 1e-9:
        raise BadInput("camera", "K", "expected 3 x 3 numbers: fx 0 cx, 0 fy cy, 0 0 1")
    fx, fy, cx, cy = (float(matrix[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2)))
    _check_size_of_k(width, height, cx, cy)
    return Intrinsics(width, height, fx, fy, cx, cy)


def distorted_intrinsics(pinhole: Intrinsics, distortion: Any) -> Intrinsics:
    """The intrinsics with OpenCV's coefficients; BadInput for a wrong number of them, or for a fold."""
    try:
        intrinsics = replace(pinhole, lens=lens_of_opencv(distortion))
    except (TypeError, ValueError) as error:
        raise BadInput("camera", "distortion", str(error)) from None
    fold = fold_of(intrinsics)
    if fold is not None:
        raise BadInput("camera", "distortion", fold)
    return intrinsics


def fold_of(i: Intrinsics) -> str | None:
    """Where the distortion folds the picture inside its frame, in words; None where it does not."""
    if i.lens.model != "fisheye" and not i.lens.bends_lines:
        return None
    # Look along the border: a fold moves inwards from there.
    side = np.linspace(0.0, 1.0, _BORDER_POINTS)
    zero, ones = np.zeros_like(side), np.ones_like(side)
    x, y = np.concatenate([side, side, zero, ones]), np.concatenate([zero, ones, side, side])
    border = np.stack([x * i.width_px, y * i.height_px], axis=1)
    lost = ~i.directions(border).any(1)
    # Beyond a fisheye's image circle nothing is lost that the lens had.
    angle = i.lens.largest_angle_rad
    is_circle = i.lens.model == "fisheye" and angle == i.lens.max_angle_rad
    if is_circle or not lost.any():
        return None
    u, v = border[lost][0]
    names = " ".join(COEFFICIENTS[i.lens.model])
    where = f"no ray falls on its point ({u:.0f}, {v:.0f}) of {i.width_px}x{i.height_px}"
    more = ", or lens.max_angle_deg below it" if i.lens.model == "fisheye" else ""
    hint = f"give other {names}, a larger lens.fx{more}"
    return f"the distortion folds the picture at {math.degrees(angle):.1f} degrees: {where}; {hint}"


def _check_size_of_k(width: int, height: int, cx: float, cy: float) -> None:
    """Refuse a K whose principal point is the middle of a larger or smaller picture.

    Then its offsets are equal shares of width and height. Cropped pictures have other offsets, and so have
    pictures with width and height swapped, for which the swapped size fits.
    """
    across, down = 2 * cx / width, 2 * cy / height
    is_scaled = abs(across - down) < _SAME_SHARE * across
    is_turned = max(abs(2 * cx / height - 1), abs(2 * cy / width - 1)) < _SAME_SHARE
    if abs(across - 1) > _OTHER_SIZE and (is_scaled or is_turned):
        text = f"{width}x{height} is not that of K, whose middle is at ({cx:g}, {cy:g})"
        hint = f"about {round(2 * cx)}x{round(2 * cy)}, or scale K"
        raise BadInput("camera", "size", text, hint=hint)


@dataclass(frozen=True, slots=True)
class CameraBlur:
    """Aperture, and motion while the shutter is open; for light only."""

    aperture_radius_m: float = 0.0  # of the entrance pupil; 0 = all depths are sharp
    focus_m: float = 1.0  # depth_z in focus
    # World frame, while the picture is taken: from the opening for the first row to the closing for
    # the last; the turn about the axis through the eye.
    velocity_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn_rad: tuple[float, float, float] = (0.0, 0.0, 0.0)
    # Shares of that time: each row is open for so long, and the last row opens so much after the first.
    open_share: float = 1.0
    rolling_share: float = 0.0
    middle_share: float = 0.0  # from mid-shutter to the middle of the rendered part

    def part(self, begin: float, end: float) -> CameraBlur:
        """The same camera while a part of its shutter's time passes, from share begin to share end."""
        middle = self.middle_share + (0.5 * (begin + end) - 0.5) * self.open_share
        return replace(self, open_share=(end - begin) * self.open_share, middle_share=middle)


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Intrinsics and pose; the pose is that of mid-shutter.

    >>> camera = Camera(intrinsics_from_k((64, 48), None, 60), np.eye(4))
    >>> camera.eye.tolist()
    [0.0, 0.0, 0.0]
    """

    intrinsics: Intrinsics
    world_from_camera: Matrix4  # OpenGL axes, metres
    blur: CameraBlur | None = None  # of light; labels are sharp
    has_own_size: bool = True  # False: it takes the size of the recipe it is rendered with

    def __post_init__(self) -> None:
        check_argument("Camera", "intrinsics", self.intrinsics, Intrinsics)
        if np.shape(self.world_from_camera) != (4, 4):
            raise BadInput("Camera", "world_from_camera", "expected a (4, 4) matrix")

    @staticmethod
    def look(
        intrinsics: Intrinsics,
        eye: F64,
        towards: F64,
        up: tuple[float, float, float] = (0.0, 1.0, 0.0),
    ) -> Camera:
        """A camera at eye (3,) looking along towards (3,), any length; up must not be parallel to it.

        >>> Camera.look(intrinsics_from_k((64, 48), None, 60), np.zeros(3), (0, 0, -2)).towards[2]
        np.float64(-1.0)
        """
        # The camera looks along -z: build the right-handed frame from its back.
        back = -np.asarray(towards, np.float64)
        across = np.cross(np.asarray(up, np.float64), back)
        if not np.linalg.norm(across) > 0 or not np.isfinite(eye).all():
            raise BadInput("camera", "", "eye, towards and up give no direction")
        back = back / np.linalg.norm(back)
        right = np.cross(np.asarray(up, np.float64), back)
        right = right / np.linalg.norm(right)
        axes = np.stack([right, np.cross(back, right), back], axis=1)
        return Camera(intrinsics, affine(axes, eye))

    @staticmethod
    @checked_call
    def look_at(
        eye: Vector,
        target: Vector,
        *,
        size: Size | None = None,
        hfov_deg: float = 60.0,
        K: Any = None,
        up: Vector = (0.0, 1.0, 0.0),
        distortion: Any = (),
    ) -> Camera:
        """A camera at eye that looks at target, world metres, y up.

        size: (width, height) in pixels; default: that of the home's recipe. hfov_deg: full horizontal field
        of view, unless K (3 x 3, pixels of the given size, x right, y down) is given. distortion: OpenCV's 4, 5, 8,
        12 or 14 coefficients, k1 k2 p1 p2 k3 ... Raises BadInput for a target at the eye, an up vector along the
        view, an invalid K or one of another size, a distortion that folds the picture.

            >>> Camera.look_at((1, 1.5, 2), (3, 1.5, 2), size=(640, 480), hfov_deg=70).towards.tolist()
            [1.0, 0.0, 0.0]
        """
        start, end = np.asarray(eye, np.float64), np.asarray(target, np.float64)
        towards = end - start
        across = np.linalg.norm(np.cross(towards, np.asarray(up, np.float64)))
        if not np.isfinite(towards).all() or across < 1e-9 * max(
            float(np.linalg.norm(towards)), 1e-9
        ):
            raise BadInput("camera", "", "eye, target and up give no direction")
        x, y, z = (float(v) for v in up)
        camera = Camera.look(
            intrinsics_from_k(size, K, hfov_deg, distortion), start, towards, (x, y, z)
        )
        return replace(camera, has_own_size=size is not None)

    @staticmethod
    @checked_call
    def from_opencv(
        world_from_camera: Any,
        K: Any = None,
        *,
        size: Size | None = None,
        hfov_deg: float = 60.0,
        distortion: Any = (),
    ) -> Camera:
        """A camera from a (4, 4) pose with OpenCV's axes: x right, y down, z forward; metres, y up.

        size, hfov_deg, K and distortion as of look_at. Raises BadInput for a pose that is not rigid, an invalid
        K or one of another size, a distortion that folds the picture.

            >>> Camera.from_opencv(np.diag([1, -1, -1, 1]), size=(64, 48)).eye.tolist()
            [0.0, 0.0, 0.0]
        """
        pose = rigid_motion(world_from_camera, "camera", "world_from_camera")
        intrinsics = intrinsics_from_k(size, K, hfov_deg, distortion)
        return Camera(intrinsics, pose @ OPENCV_FROM_OPENGL, has_own_size=size is not None)

    @property
    def eye(self) -> F64:
        """(3,) position in the world, metres.

        >>> Camera.look_at((1, 1.5, 2), (3, 0.8, 2)).eye.tolist()
        [1.0, 1.5, 2.0]
        """
        return self.world_from_camera[:3, 3]

    @property
    def towards(self) -> F64:
        """(3,) unit view direction in the world.

        >>> Camera.look_at((0, 0, 0), (0, 0, -3)).towards.tolist()
        [0.0, 0.0, -1.0]
        """
        return np.asarray(-self.world_from_camera[:3, 2])

    def with_size(self, width_px: int, height_px: int) -> Camera:
        """The same camera on another pixel grid.

        >>> Camera.look_at((0, 0, 0), (1, 0, 0)).with_size(64, 48).intrinsics.width_px
        64
        """
        if min(width_px, height_px) < 1:
            raise BadInput("with_size", "", f"{width_px}x{height_px} is not a size")
        intrinsics = self.intrinsics.resized(width_px, height_px)
        return replace(self, intrinsics=intrinsics, has_own_size=True)

    def pixels_of(self, points: NDArray[np.floating]) -> F64:
        """(N, 2) pixel coordinates (x, y) of points (N, 3) of the world, in metres.

        NaN for those the lens does not see; others may lie beside the picture.

            >>> Camera.look_at((0, 0, 0), (0, 0, -1)).pixels_of(np.array([[0, 0, -3.0]])).tolist()
            [[320.0, 240.0]]
        """
        return self.intrinsics.pixels(self._from_world(points) * _FLIP)

    def depths_of(self, points: NDArray[np.floating]) -> F64:
        """(N,) depth of points (N, 3) of the world, as depth_z has it: metres.

        Along the optical axis (negative behind the camera), of a lens without planar depth the
        distance from the eye.

            >>> Camera.look_at((0, 0, 0), (0, 0, -1)).depths_of(np.array([[1, 0, -3.0]])).tolist()
            [3.0]
        """
        local = self._from_world(points)
        if self.intrinsics.lens.depth_is_planar:
            return np.asarray(-local[:, 2])
        return np.asarray(np.linalg.norm(local, axis=1))

    def _from_world(self, points: NDArray[np.floating]) -> F64:
        world_points = np.asarray(points, np.float64)
        if world_points.ndim != 2 or world_points.shape[1] != 3:
            raise BadInput("camera", "points", f"expected (N, 3), got {world_points.shape}")
        moved = world_points - self.eye
        return np.asarray(moved @ self.world_from_camera[:3, :3])

    @property
    def blind(self) -> Mask | None:
        """(H, W) bool: the pixel has no ray (outside a fisheye's circle); None if every pixel has one.

        >>> Camera.look_at((0, 0, 0), (0, 0, -1)).blind is None
        True
        """
        if self.intrinsics.lens.model != "fisheye":
            return None
        blind = np.asarray(~_lens_grid(self.intrinsics).any(-1))
        return blind if blind.any() else None

    def rays(self) -> tuple[F32, F32]:
        """Rays through the pixels' centres: origin (3,) and directions (H, W, 3), float32, world.

        t along a ray is the pixel's depth_z: directions have unit length along the optical axis,
        of a lens without planar depth unit length; (0, 0, 0) where a pixel is blind.

            >>> origin, directions = Camera.look_at((0, 1, 0), (0, 1, -1), size=(64, 48)).rays()
            >>> origin.tolist(), directions.shape
            ([0.0, 1.0, 0.0], (48, 64, 3))
        """
        origin, directions = self.exact_rays()
        return origin.astype(np.float32), directions.astype(np.float32)

    def exact_rays(self) -> tuple[F64, F64]:
        """As rays, in float64.

        >>> Camera.look_at((0, 1, 0), (0, 1, -1), size=(64, 48)).exact_rays()[1].dtype
        dtype('float64')
        """
        i = self.intrinsics
        if not i.lens.is_pinhole:
            return self.eye, _lens_grid(i) @ self.world_from_camera[:3, :3].T
        # A point of each pixel on the plane z = -1 of the camera: unit length along the axis.
        x = (np.arange(i.width_px) + 0.5 - i.cx) / i.fx
        y = -(np.arange(i.height_px) + 0.5 - i.cy) / i.fy
        grid = np.empty((i.height_px, i.width_px, 3), np.float64)
        grid[..., 0] = x[None, :]
        grid[..., 1] = y[:, None]
        grid[..., 2] = -1.0
        return self.eye, grid @ self.world_from_camera[:3, :3].T


def camera_of_recipe(camera: Camera, width_px: int, height_px: int) -> Camera:
    """The camera at its size, else at the size of a recipe's pictures, with square pixels."""
    if camera.has_own_size:
        return camera
    hfov_rad = 2 * math.atan(0.5 * camera.intrinsics.width_px / camera.intrinsics.fx)
    intrinsics = Intrinsics.from_hfov(width_px, height_px, hfov_rad)
    return replace(camera, intrinsics=intrinsics, has_own_size=True)


def rigid_motion(matrix: Any, call: str, name: str) -> F64:
    """A (4, 4) matrix that turns and moves, as an array; BadInput, naming the argument, for others."""
    try:
        motion = np.asarray(matrix, np.float64)
    except (TypeError, ValueError):
        motion = np.zeros(0)
    turn = motion[:3, :3] if motion.shape == (4, 4) else np.zeros((3, 3))
    fits = np.allclose(turn @ turn.T, np.eye(3), atol=1e-4) and np.linalg.det(turn) > 0
    if not fits or not np.isfinite(motion).all() or not np.allclose(motion[3], [0, 0, 0, 1]):
        raise BadInput(call, name, "is not a rigid (4, 4) motion: a rotation and metres")
    return motion


@functools.lru_cache(maxsize=4)
def _lens_grid(i: Intrinsics) -> F64:
    """(H, W, 3) directions through the pixels' centres, OpenGL's camera axes; cached, do not write to it."""
    x, y = np.meshgrid(np.arange(i.width_px) + 0.5, np.arange(i.height_px) + 0.5)
    directions = i.directions(np.stack([x.ravel(), y.ravel()], axis=1)) * _FLIP
    directions.setflags(write=False)
    return directions.reshape(i.height_px, i.width_px, 3)


@functools.lru_cache(maxsize=4)
def _lens_faces(i: Intrinsics) -> PinholeFaces:
    return faces_of_directions(_lens_grid(i) * _FLIP)


def pinholes_of(camera: Camera) -> tuple[list[Camera], PinholeFaces]:
    """Pin-hole cameras at the same eye that together see what the camera does, and the way back."""
    faces = _lens_faces(camera.intrinsics)
    cameras = []
    for face in faces.faces:
        # The face's axes as columns, both frames with OpenGL's axes.
        turned = camera.world_from_camera.copy()
        turned[:3, :3] = camera.world_from_camera[:3, :3] @ (_FLIP[:, None] * face.axes.T * _FLIP)
        f = face.focal_px
        cameras.append(
            Camera(Intrinsics(face.width_px, face.height_px, f, f, face.cx, face.cy), turned)
        )
    return cameras, faces


@dataclass(frozen=True, slots=True, eq=False)
class RigPlace:
    """Which camera of a rig a view is taken by."""

    name: str  # of the rig
    camera: str  # of the camera in it
    instant: str  # id of the view that the rig's first camera takes then
    rig_from_camera: Matrix4  # OpenCV axes, metres


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A camera with its place in a house."""

    id: str  # core/shot.py
    room_id: str
    sector: int
    camera: Camera
    # "sampled", "stored" (placed by the home's author), "file" (the user's), "walk", "trajectory"
    origin: str = "sampled"
    score: float = 0.0  # of the sampler; 0 without one
    objects: dict[int, int] = field(default_factory=dict)  # instance id -> pixels when scored
    frame: int | None = None  # number in a sequence, from 0
    time_s: float | None = None  # of that frame
    rig: RigPlace | None = None  # where several cameras take each view together

    @property
    def shot(self) -> Shot:
        """Take, frame and camera of the rig, parsed from the id."""
        if self.rig is None or self.rig.instant == self.id:
            return Shot.of_id(self.id)
        return Shot.of_id(self.id, (self.rig.camera,))
