"""A camera that moves to the right while its shutter is open."""

import sys

import pbrs_farm as pf

home = pf.load(*sys.argv[1:2] or ["Studio"], recipe="preview")
home = home.set(**{"blur.shutter_s": 0.04, "blur.right_mps": 1.0})
pf.render(home, home.cameras(n=1)).save("out/motion_blur")
