"""Encoded pictures."""

from __future__ import annotations

import io

from PIL import Image


def picture(encoding: str = "PNG", alpha: int | None = None) -> bytes:
    image = Image.new("RGB" if alpha is None else "RGBA", (8, 8), (200, 40, 30))
    if alpha is not None:
        image.putalpha(alpha)
    buffer = io.BytesIO()
    image.save(buffer, encoding)
    return buffer.getvalue()
