"""From views to shards to arrays: what a loader reads."""

import sys

import numpy as np

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
pf.render(home, home.cameras(n=2)).save("out/batch/views")
pf.pack(pf.open("out/batch/views"), "out/batch/shards", pf.Packing((64, 48), modes=("mlt_il_ol",)))
samples = [frame.sample() for frame in pf.open("out/batch/shards")]
print(np.stack([s.colour for s in samples]).shape, np.stack([s.normal for s in samples]).shape)
