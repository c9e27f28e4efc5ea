"""Classes and instances as arrays, and a custom class table applied to them."""

import sys

import numpy as np

import pbrs_farm as pf

MINE = {"chair": 1, "sofa": 1, "table": 2, "desk": 2, "floor": 3}
home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
frame = pf.render(home, home.cameras(n=1)[0], modes=[])
of_instance = np.zeros(int(frame.instance.max()) + 1, np.uint8)
for row in frame.instances:
    of_instance[row["id"]] = MINE.get(row["class"], 0)
mine = of_instance[frame.instance]
print({name: int((mine == number).sum()) for name, number in MINE.items()})
