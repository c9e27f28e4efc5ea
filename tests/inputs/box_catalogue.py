"""A catalogue whose pieces are boxes."""

from __future__ import annotations

import numpy as np

from pbrs_farm.core.catalogue import Catalogue, Piece, Shape
from pbrs_farm.core.house import Material
from pbrs_farm.geometry.solids import box_quads, quads_surface
from tests.generate.furnish.shelves import plain_catalogue


def boxes() -> Catalogue:
    """The plain catalogue with a box of its size for each piece."""

    def box(piece: Piece) -> Shape:
        w, d, h = piece.size
        half = np.array([w, h, d]) / 2
        quads = box_quads(np.array([0.0, h / 2, 0.0]), half)
        return Shape((quads_surface("box", quads, 0),), (Material("grey"),))

    return Catalogue(plain_catalogue().pieces, box, "boxes")
