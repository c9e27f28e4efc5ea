"""HTML of frames for notebooks: pictures with their titles. Effects: reads pictures."""

from __future__ import annotations

import base64
import html
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.errors import BadInput
from pbrs_farm.images import jpeg_from_array, thumbnail

if TYPE_CHECKING:
    from pbrs_farm.views.views import Frame, Views

MOST_SHOWN: Final = 24
"""Maximum number of pictures in one cell of a notebook."""
_PICTURE_PX: Final = 320  # width of a frame's picture
_THUMB_PX: Final = 160  # width of a picture among many


def frame_html(frame: Frame) -> str:
    """The frame's id and its picture in each mode."""
    cells = "".join(figure_html(mode, frame.picture(mode), _PICTURE_PX) for mode in frame.modes)
    return f"<div><code>{html.escape(frame.id)}</code><br>{cells}</div>"


def views_html(views: Views) -> str:
    """Small pictures of at most MOST_SHOWN frames, spread evenly."""
    numbers = np.unique(np.linspace(0, len(views) - 1, min(len(views), MOST_SHOWN)).round())
    cells = "".join(_small_figure(views[int(k)]) for k in numbers)
    part = f", {len(numbers)} of them shown" if len(numbers) < len(views) else ""
    return f"<div><code>{html.escape(repr(views))}</code>{part}<br>{cells}</div>"


def _small_figure(frame: Frame) -> str:
    try:
        return figure_html(frame.id, frame.colour, _THUMB_PX)
    except BadInput as error:
        # Show the error in its place, so that the other frames are visible.
        return f"<p>{html.escape(str(error))}</p>"


def figure_html(title: str, rgb: NDArray[np.uint8], width_px: int) -> str:
    """A picture (H, W, 3) sRGB, width_px wide, as a JPEG for dense screens over its escaped title."""
    small = thumbnail(rgb, max_edge_px=2 * width_px)
    data = base64.b64encode(jpeg_from_array(small)).decode()
    return (
        f'<figure style="display:inline-block;margin:4px"><img width="{width_px}"'
        f' src="data:image/jpeg;base64,{data}"><figcaption style="max-width:{width_px}px;'
        f'overflow-wrap:anywhere">{html.escape(title)}</figcaption></figure>'
    )
