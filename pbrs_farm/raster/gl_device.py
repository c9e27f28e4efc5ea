"""OpenGL objects of the rasterizer, all of one EGL context: render targets, textures."""

from __future__ import annotations

from typing import Any, Final

import moderngl
import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.errors import MachineFailed
from pbrs_farm.core.frames import srgb_from_linear
from pbrs_farm.installation import system_command

_SRGB8_ALPHA8: Final = 0x8C43  # OpenGL's internal format: the GPU decodes sRGB when it samples
_MAX_TEXTURE_PX: Final = 4096  # every OpenGL 3.3 driver takes as much


def n_samples(context: Any, n_wanted: int) -> int:
    """Samples a pixel: as wanted or as the context can give, 2 at least."""
    return max(2, min(n_wanted, int(context.max_samples)))


def open_context() -> Any:
    """A headless OpenGL 3.3 context; raises MachineFailed without one.

    Through EGL, which needs no display; else through moderngl's default (X11, CGL, WGL). For libraries with
    unusual names glcontext starts a process each: 0.1 s for a large parent.
    """
    faults = []
    ways: dict[str, Any] = {
        "EGL by its usual name": {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"},
        "EGL": {"backend": "egl"},
        "the system's own": {},
    }
    for name, settings in ways.items():
        try:
            context = moderngl.create_context(require=330, standalone=True, **settings)
        except Exception as error:  # noqa: BLE001  glcontext raises bare Exception
            faults.append(f"{name}: {error}")
        else:
            context.enable(moderngl.DEPTH_TEST)
            return context
    text = f"no headless OpenGL 3.3 on this machine ({'; '.join(faults)})"
    raise MachineFailed(text, hint=system_command("gl"))


def texture_from_pixels(
    context: Any, pixels: NDArray[np.uint8], repeats: tuple[bool, bool] = (True, True)
) -> Any:
    """A mipmapped sRGB texture from (H, W, 3 or 4) uint8, row 0 = top.

    pixels: sRGB bytes; without alpha it is opaque. repeats: along u and v; where it does not, its edge
    goes on, or coarse levels would mix the colours of both ends at the border. Larger pictures than OpenGL must accept are
    thinned by whole steps, not filtered. Lives as long as the context: release both.
    """
    # Subsample textures larger than OpenGL's guaranteed limit.
    step = -(-max(pixels.shape[:2]) // _MAX_TEXTURE_PX)
    thinned = pixels[::step, ::step]
    rgba = np.full((*thinned.shape[:2], 4), 255, np.uint8)
    # Upload bottom row first, as OpenGL counts v.
    rgba[..., : thinned.shape[2]] = thinned[::-1]
    size = (rgba.shape[1], rgba.shape[0])
    texture = context.texture(size, 4, rgba, internal_format=_SRGB8_ALPHA8)
    texture.build_mipmaps()
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.repeat_x, texture.repeat_y = repeats
    return texture


class RenderTarget:
    """A framebuffer of multisampled half floats, resolved on read; prepass_depth: of a first pass."""

    def __init__(self, context: Any, size: tuple[int, int], samples: int) -> None:
        self._context, self._size = context, size
        # Draw into several samples a pixel and resolve into a second framebuffer.
        plane = context.renderbuffer(size, 4, dtype="f2", samples=samples)
        depth = context.depth_renderbuffer(size, samples=samples)
        self._drawn = context.framebuffer([plane], depth)
        self._resolved = context.framebuffer([context.renderbuffer(size, 4, dtype="f2")])
        self.prepass_depth = context.depth_texture(size, samples=samples)
        self._depths = context.framebuffer([], self.prepass_depth)

    def begin_depth_prepass(self) -> None:
        """Clear prepass_depth and draw depth into it from now on."""
        self._depths.use()
        self._depths.clear(depth=1.0)

    def begin(self, colour: tuple[float, ...]) -> None:
        """Clear to this colour and draw here from now on."""
        self._drawn.use()
        self._drawn.clear(*colour, depth=1.0)

    def read(self) -> NDArray[np.float16]:
        """(H, W, 3) float16 linear colour, row 0 = top, averaged over the samples; waits for the driver."""
        self._context.copy_framebuffer(self._resolved, self._drawn)
        raw = self._resolved.read(components=3, dtype="f2", alignment=1)
        pixels = np.frombuffer(raw, np.float16).reshape(*self._size[::-1], 3)
        return np.ascontiguousarray(pixels[::-1])


def _encoding_table() -> NDArray[np.uint8]:
    """(65536,) sRGB byte of every half float, by its bits; below 0 and NaN are 0, above 1 is 255."""
    halves = np.arange(65536, dtype=np.uint16).view(np.float16).astype(np.float64)
    linear = np.clip(np.nan_to_num(halves, nan=0.0), 0.0, 1.0)
    return np.rint(srgb_from_linear(linear) * 255).astype(np.uint8)


_SRGB8_OF_HALF: Final = _encoding_table()


def srgb8_from_half(linear: NDArray[np.float16]) -> Srgb8Image:
    """sRGB bytes of linear half floats (..., 3), by a table of all half floats: exact and quick."""
    return _SRGB8_OF_HALF[linear.view(np.uint16)]
