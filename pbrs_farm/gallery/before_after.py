"""Two pictures of one view side by side, with a line below; no effects."""

from __future__ import annotations

import io
import textwrap
from typing import Final

from PIL import Image, ImageDraw

from pbrs_farm.core.arrays import Srgb8Image
from pbrs_farm.core.shown_text import shown
from pbrs_farm.gallery.contact_sheet import PAPER
from pbrs_farm.gallery.lettering import draw_line

_GAP_PX: Final = 8
_LINE_PX: Final = 16  # of the caption
_MOST_LINES: Final = 6
_FAINT: Final = (142, 149, 163)


def before_after_png(before: Srgb8Image, after: Srgb8Image, caption: str) -> bytes:
    """PNG of two pictures (H, W, 3) of one size, before on the left, and a caption below.

    A long caption takes several lines: credits are shown whole.
    """
    height, width = before.shape[:2]
    # A letter of size 12 is about 6 px wide.
    most = max(20, (2 * width) // 6)
    lines = textwrap.wrap(shown(caption, most * _MOST_LINES), most)[:_MOST_LINES] or [""]
    size = (2 * width + _GAP_PX, height + 8 + _LINE_PX * len(lines))
    sheet = Image.new("RGB", size, PAPER)
    sheet.paste(Image.fromarray(before), (0, 0))
    sheet.paste(Image.fromarray(after), (width + _GAP_PX, 0))
    draw = ImageDraw.Draw(sheet)
    for k, line in enumerate(lines):
        draw_line(draw, (6, height + 5 + k * _LINE_PX), line, fill=_FAINT, size=12)
    file = io.BytesIO()
    sheet.save(file, "PNG", compress_level=6)
    return file.getvalue()
