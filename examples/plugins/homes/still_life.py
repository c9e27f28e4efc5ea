"""A scene family: a generated home with a few boxes on its tables, drawn by a seed.

pbrs-farm run plugin:still_life,1..10 --out out/still
"""

from __future__ import annotations

from pathlib import Path

import pbrs_farm as pf

_BOX = Path(__file__).with_name("still_life_box.off")


def still_life(seed: int, count: str = "3", base: str = "builtin") -> pf.Home:
    """The home of a seed. Options of the word come as text: plugin:still_life,7,count=5."""
    box = pf.model(_box(), category="box", up="y")
    return pf.load(base).scatter([box], n=int(count), seed=seed)


def _box() -> Path:
    """A box of 10 x 6 x 14 cm beside this module, written once."""
    if not _BOX.exists():
        corners = [(x, y, z) for x in (0, 0.1) for y in (0, 0.06) for z in (0, 0.14)]
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        lines = ["OFF", "8 6 0", *(" ".join(map(str, c)) for c in corners)]
        lines += ["4 " + " ".join(map(str, q)) for q in quads]
        _BOX.write_text("\n".join(lines) + "\n")
    return _BOX
