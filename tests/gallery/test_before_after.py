"""Two pictures of one view side by side."""

import io

import numpy as np
from PIL import Image

from pbrs_farm.gallery.contact_sheet import before_after_png


def _sheet(caption: str) -> Image.Image:
    picture = np.zeros((40, 60, 3), np.uint8)
    return Image.open(io.BytesIO(before_after_png(picture, picture, caption)))


def test_a_long_caption_takes_more_lines_and_loses_nothing_in_the_middle() -> None:
    short, long = _sheet("Studio"), _sheet("models of many people " * 4)
    assert short.size[0] == long.size[0]
    assert long.size[1] >= short.size[1] + 3 * 16
    # Its first and last lines contain letters.
    rows = np.asarray(long.convert("L"), np.int64)[40:].std(1) > 1
    assert rows[:22].any()
    assert rows[-20:].any()
