"""Pictures as an mp4 film (H.264); the only user of PyAV; no effects."""

from __future__ import annotations

import io
from collections.abc import Iterable
from fractions import Fraction
from typing import Any, Final

import numpy as np

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.installation import need

_QUALITY: Final = "20"  # H.264's constant rate factor: visually clean
_DEFAULT_FPS: Final = 30.0  # of frames without times


def film(pictures: Iterable[Srgb8Image], fps: Fraction) -> bytes:
    """An mp4 file (H.264, 4:2:0, even size, the same bytes each time) of uint8 sRGB pictures (H, W, 3)."""
    need("av")
    import av

    buffer = io.BytesIO()
    with av.open(buffer, "w", format="mp4") as container:
        stream: Any = None
        for rgb in pictures:
            height, width = (n // 2 * 2 for n in rgb.shape[:2])
            if stream is None:
                stream = container.add_stream("libx264", rate=fps)
                stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
                stream.options = {"crf": _QUALITY, "threads": "1"}
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(rgb[:height, :width]), "rgb24")
            container.mux(stream.encode(frame))
        container.mux(stream.encode() if stream is not None else [])
    return buffer.getvalue()


def film_pace(first: tuple[int, float], last: tuple[int, float]) -> Fraction:
    """Frames a second between two frames, (number, seconds) each; 30 for equal times."""
    frames, seconds = last[0] - first[0], last[1] - first[1]
    pace = frames / seconds if seconds > 0 else _DEFAULT_FPS
    return Fraction(pace).limit_denominator(1001)
