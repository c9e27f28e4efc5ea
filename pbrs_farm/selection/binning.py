"""Choice of a reference's binning by leave-one-out tests, from fine to coarse, of five; no effects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from pbrs_farm.core.record import Record
from pbrs_farm.selection.histograms import coarser_colour, coarser_depth, normalised
from pbrs_farm.selection.similarity import best_match

MIN_PASSING: Final = 0.95  # share of the reference's own images that pass at the chosen binning


class Binning(Record):
    """Histogram bins of a comparison: joint colour bins, and depth bins over the range of the settings."""

    colour: tuple[int, int, int]  # bins of each channel
    depth: int

    @property
    def n_colour(self) -> int:
        """Total number of colour bins."""
        return self.colour[0] * self.colour[1] * self.colour[2]


# Coarse to fine; each is an exact sum of the bins of the next.
BINNINGS: Final = tuple(
    Binning(colour=colour, depth=depth)
    for colour, depth in (
        ((2, 2, 2), 8),
        ((4, 4, 2), 16),
        ((4, 4, 4), 32),
        ((8, 8, 4), 64),
        ((8, 8, 8), 128),
    )
)


class BinningRow(Record):
    """Leave-one-out scores of a reference's images at one binning."""

    binning: Binning
    colour_passing: float  # share of the images above the threshold
    colour_median: float  # median best intersection
    depth_passing: float
    depth_median: float


def binning_table(
    colour: NDArray[np.integer], depth: NDArray[np.integer], *, min_colour: float, min_depth: float
) -> tuple[BinningRow, ...]:
    """A row for each of BINNINGS that counts (n, bins) can be reduced to; ValueError below two images."""
    if len(colour) < 2:
        raise ValueError("a reference needs two images at least: each is compared with the others")
    rows = []
    for binning in BINNINGS:
        # Skip binnings finer than the counts.
        if max(binning.colour) ** 3 > colour.shape[1] or binning.depth > depth.shape[1]:
            continue
        c = normalised(coarser_colour(colour, binning.colour))
        d = normalised(coarser_depth(depth, binning.depth))
        # Match every image with all the others.
        c_best, _ = best_match(c, c, leave_out_self=True)
        d_best, _ = best_match(d, d, leave_out_self=True)
        rows.append(
            BinningRow(
                binning=binning,
                colour_passing=float((c_best > min_colour).mean()),
                colour_median=float(np.median(c_best)),
                depth_passing=float((d_best > min_depth).mean()),
                depth_median=float(np.median(d_best)),
            )
        )
    return tuple(rows)


def finest_passing(rows: Sequence[BinningRow]) -> Binning:
    """The finest (or coarsest) colour bins and, separately, depth bins that enough images pass."""
    # Rows run from coarse to fine, so the last that passes is the finest.
    colour = [r.binning.colour for r in rows if r.colour_passing >= MIN_PASSING]
    depth = [r.binning.depth for r in rows if r.depth_passing >= MIN_PASSING]
    coarsest = rows[0].binning
    return Binning(
        colour=colour[-1] if colour else coarsest.colour,
        depth=depth[-1] if depth else coarsest.depth,
    )


def table_text(rows: Sequence[BinningRow], chosen: Binning) -> str:
    """The table, coarsest first, as text, "*" at the chosen bins, with a line if even these fail."""
    lines = ["colour bins      pass  median    depth bins  pass  median"]
    for r in rows:
        c = "*" if r.binning.colour == chosen.colour else " "
        d = "*" if r.binning.depth == chosen.depth else " "
        name = "x".join(str(k) for k in r.binning.colour)
        lines.append(
            f"{c} {name:<8}{r.binning.n_colour:>5} {100 * r.colour_passing:>5.1f} % "
            f"{r.colour_median:>6.3f}  {d} {r.binning.depth:>8} {100 * r.depth_passing:>5.1f} % "
            f"{r.depth_median:>6.3f}"
        )
    # Report if too few images pass even the coarsest binning.
    coarsest = rows[0]
    for name, passing in (("colour", coarsest.colour_passing), ("depth", coarsest.depth_passing)):
        if passing < MIN_PASSING:
            lines.append(f"no binning lets {MIN_PASSING:.0%} pass by {name}: the coarsest is taken")
    return "\n".join(lines)
