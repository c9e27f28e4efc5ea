"""COCO's run lengths of masks, plain and compressed; no effects."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def run_lengths(mask: NDArray[np.bool_]) -> dict[str, list[int]]:
    """COCO's uncompressed run lengths of mask (H, W): column by column, zeros first."""
    # Cut where the value changes; a mask that starts with ones has a first run of 0.
    flat = mask.T.reshape(-1)
    changes = np.nonzero(np.diff(flat, prepend=False))[0]
    counts = np.diff(np.concatenate([[0], changes, [flat.size]]))
    return {"size": [int(n) for n in mask.shape], "counts": [int(n) for n in counts]}


def compressed_runs(mask: NDArray[np.bool_]) -> dict[str, list[int] | str]:
    """COCO's compressed run lengths: counts as text, as pycocotools and every reader take them."""
    runs = run_lengths(mask)
    counts, text = runs["counts"], []
    for k, count in enumerate(counts):
        # From the fourth on, a count is its difference from the last but one.
        text.append(_digits(count - counts[k - 2] if k > 2 else count))
    return {"size": runs["size"], "counts": "".join(text)}


def _digits(value: int) -> str:
    """A signed number in digits of 5 bits, lowest first, as characters from "0" on."""
    text = []
    while True:
        digit = value & 0x1F
        value >>= 5
        # The number ends where the rest is its sign alone.
        is_last = value == (-1 if digit & 0x10 else 0)
        text.append(chr(48 + digit + (0 if is_last else 0x20)))
        if is_last:
            return "".join(text)
