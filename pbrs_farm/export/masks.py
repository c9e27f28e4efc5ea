"""Masks in the forms of other tools: COCO's run lengths, plain and compressed, and polygons; no effects."""

from __future__ import annotations

from typing import Final

import numpy as np
import shapely
from numpy.typing import NDArray

_TOLERANCE_PX: Final = (
    0.75  # tolerance of a polygon's outline, smooths the steps of a slanting edge
)


def run_lengths(mask: NDArray[np.bool_]) -> dict[str, list[int]]:
    """COCO's uncompressed run lengths of mask (H, W): column by column, zeros first.

    mask is (H, W) bool. Fit for JSON; pycocotools takes it after frPyObjects. "size" is [height,
    width].
    """
    # Cut where the value changes; a mask that starts with ones has a first run of 0.
    flat = mask.T.reshape(-1)
    changes = np.nonzero(np.diff(flat, prepend=False))[0]
    counts = np.diff(np.concatenate([[0], changes, [flat.size]]))
    return {"size": [int(n) for n in mask.shape], "counts": [int(n) for n in counts]}


def compressed_runs(mask: NDArray[np.bool_]) -> dict[str, list[int] | str]:
    """COCO's compressed run lengths of mask (H, W) bool: counts as text, for pycocotools.

    The counts are those of run_lengths; from the fourth on, each is the difference from the last but one,
    in digits of 5 bits (maskApi.c).
    """
    runs = run_lengths(mask)
    counts, text = runs["counts"], []
    for k, count in enumerate(counts):
        text.append(_digits(count - counts[k - 2] if k > 2 else count))
    return {"size": runs["size"], "counts": "".join(text)}


def _digits(value: int) -> str:
    """A signed number in digits of 5 bits, lowest first, as characters from "0" on."""
    text = []
    while True:
        digit = value & 0x1F
        value >>= 5
        # The number ends when only its sign is left.
        is_last = value == (-1 if digit & 0x10 else 0)
        text.append(chr(48 + digit + (0 if is_last else 0x20)))
        if is_last:
            return "".join(text)


def mask_polygons(mask: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """(N, 2) x, y in px from the corner of mask (H, W), of each of its parts, the largest first.

    Pixels that share an edge are one part. The outline keeps within a pixel of the mask's. Holes
    are cut: the ring goes to a hole, around it and back the same way.
    """
    # Runs of each row as boxes, joined.
    steps = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (y, x0), (_y, x1) = np.nonzero(steps > 0), np.nonzero(steps < 0)
    parts = shapely.get_parts(shapely.union_all(shapely.box(x0, y, x1, y + 1))).tolist()
    parts = [shapely.simplify(part, _TOLERANCE_PX) for part in sorted(parts, key=_minus_area)]
    return [_one_ring(part) for part in parts if isinstance(part, shapely.Polygon)]


def _minus_area(part: shapely.Polygon) -> float:
    return -float(part.area)


def _one_ring(part: shapely.Polygon) -> NDArray[np.float64]:
    ring = shapely.get_coordinates(part.exterior)
    for interior in part.interiors:
        hole = shapely.get_coordinates(interior)[:-1]
        # Connect them where they are closest.
        gaps = np.linalg.norm(ring[:, None] - hole[None], axis=-1)
        i, j = np.unravel_index(int(gaps.argmin()), gaps.shape)
        ring = np.concatenate([ring[: i + 1], hole[j:], hole[: j + 1], ring[i:]])
    # The last corner repeats the first.
    return np.asarray(ring[:-1])
