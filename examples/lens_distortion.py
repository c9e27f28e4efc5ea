"""A lens that bends lines, and labels that bend with it."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.set(**{"lens.model": "radtan", "lens.k1": -0.15, "lens.k2": 0.02})
pf.render(home, home.cameras(n=1)).save("out/lens_distortion")
