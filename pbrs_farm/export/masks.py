"""Masks in the forms of other tools: COCO's run lengths, plain and compressed, and polygons; no effects."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_erosion
from scipy.spatial.distance import cdist

_TOLERANCES_PX: Final = (0.75, 0.5, 0.25)  # of a polygon's outline, 0.75 smooths a slanting edge
_LEAST_IOU: Final = 0.97  # minimum IoU of a smoothed polygon and its mask


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


def mask_polygon(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """(N, 2) x, y in px from the corner of mask (H, W): one ring around all its parts.

    The ring goes to each hole and to each further part, around it and back the same way, as Ultralytics
    joins COCO's polygons. Slanting edges are smoothed while the IoU with the mask is at least 0.97.
    """
    # Runs of each row as boxes, joined.
    steps = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    (y, x0), (_y, x1) = np.nonzero(steps > 0), np.nonzero(steps < 0)
    exact = shapely.union_all(shapely.box(x0, y, x1, y + 1))
    smooth = (shapely.simplify(exact, tolerance) for tolerance in _TOLERANCES_PX)
    outline = next(
        (o for o in smooth if _mask_iou(mask, o) >= _LEAST_IOU), shapely.simplify(exact, 0)
    )
    parts = sorted(shapely.get_parts(outline).tolist(), key=lambda part: -float(part.area))
    rings = [shapely.get_coordinates(r)[:-1] for p in parts for r in (p.exterior, *p.interiors)]
    ring = rings[0]
    for other in rings[1:]:
        # Connect them where they are closest.
        gaps = cdist(ring, other)
        i, j = np.unravel_index(int(gaps.argmin()), gaps.shape)
        ring = np.concatenate([ring[: i + 1], other[j:], other[: j + 1], ring[i:]])
    return np.asarray(ring)


def _mask_iou(mask: NDArray[np.bool_], outline: Any) -> float:
    """Least IoU of a mask with the pixels whose centre is in an outline less than a pixel from the mask's.

    A centre on the outline counts as lost, or as added: readers differ.
    """
    around = np.ones((3, 3), bool)
    eroded, dilated = binary_erosion(mask, around), binary_dilation(mask, around)
    (set_y, set_x), (unset_y, unset_x) = np.nonzero(mask & ~eroded), np.nonzero(dilated & ~mask)
    shapely.prepare(outline)
    n_lost = np.count_nonzero(~shapely.contains_xy(outline, set_x + 0.5, set_y + 0.5))
    n_added = np.count_nonzero(shapely.intersects_xy(outline, unset_x + 0.5, unset_y + 0.5))
    n_set = np.count_nonzero(mask)
    return (n_set - n_lost) / (n_set + n_added)
