"""A small catalogue of plain boxes, enough to furnish every room."""

from __future__ import annotations

from functools import cache

from pbrs_farm.core.catalogue import Catalogue, Piece, Place

_PIECES = {
    "bed": ((1.6, 2.1, 0.9), (0.95, 2.05, 0.8)),
    "nightstand": ((0.45, 0.4, 0.5),),
    "wardrobe": ((1.0, 0.55, 2.0),),
    "desk": ((1.2, 0.6, 0.74),),
    "chair": ((0.45, 0.5, 0.9),),
    "sofa": ((1.9, 0.85, 0.85), (1.5, 0.8, 0.85)),
    "armchair": ((0.75, 0.8, 0.85),),
    "coffee_table": ((1.1, 0.6, 0.45),),
    "tv_stand": ((1.35, 0.45, 0.5),),
    "tv": ((1.0, 0.15, 0.6),),
    "dining_table": ((1.4, 0.8, 0.75), (0.7, 0.7, 0.75)),
    "bookcase": ((0.9, 0.35, 1.9),),
    "shelves": ((0.6, 0.35, 1.2),),
    "dresser": ((1.0, 0.5, 0.8),),
    "plant": ((0.4, 0.4, 0.9),),
    "floor_lamp": ((0.35, 0.35, 1.6),),
    "fridge": ((0.6, 0.62, 1.85),),
    "cooker": ((0.6, 0.6, 0.86),),
    "sink": ((0.6, 0.6, 1.1),),
    "base_cabinet": ((0.6, 0.6, 0.88),),
    "upper_cabinet": ((0.6, 0.36, 0.7),),
    "hood": ((0.6, 0.5, 0.4),),
    "toilet": ((0.38, 0.65, 0.77),),
    "washbasin": ((0.6, 0.45, 0.9), (0.45, 0.35, 0.9)),
    "bathtub": ((1.65, 0.73, 0.57),),
    "shower": ((0.8, 0.8, 2.0),),
    "washer": ((0.6, 0.6, 0.85),),
    "clothes_rack": ((1.1, 0.36, 1.3),),
    "ceiling_lamp": ((0.3, 0.3, 0.06), (0.5, 0.5, 0.6)),
}
_PLACES = {
    "tv": Place.SURFACE,
    "ceiling_lamp": Place.CEILING,
    "upper_cabinet": Place.WALL,
    "cooker": Place.KITCHEN,
    "sink": Place.KITCHEN,
    "base_cabinet": Place.KITCHEN,
    "hood": Place.KITCHEN,
}


@cache
def plain_catalogue() -> Catalogue:
    """A catalogue of boxes of every group that rooms need; no shapes."""
    pieces = tuple(
        Piece(
            f"plain#{group}{k}",
            group,
            group,
            _PLACES.get(group, Place.FLOOR),
            39,
            size,
            library="plain",
        )
        for group, sizes in _PIECES.items()
        for k, size in enumerate(sizes)
    )
    return Catalogue(pieces, lambda _piece: None, "plain")
