"""A camera that pans while its rows are lit one after another: upright edges lean."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.set(**{"blur.rolling_s": 0.03, "blur.shutter_s": 0.005, "blur.pan_dps": 90.0})
pf.render(home, home.cameras(n=1)).save("out/rolling_shutter")
